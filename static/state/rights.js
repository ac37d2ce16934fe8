// @ts-check
/**
 * What somebody may do, and where. The one place that the interface asks: buttons by `data-needs` (views/needs.js),
 * keys by `needs`, edits and verdicts before they are made (state/group.js).
 */

import { COPIES, me } from './me.js';
import { complain } from './notice.js';

/** @import {Action, Role} from '../api/people.js' */

const ACTION_LABELS = /** @type {Record<Action, string>} */ ({
	account: 'This', read: 'Looking at this', annotate: 'Editing', review: 'Reviewing or exporting',
	lead: 'This', administer: 'This',
});

/** What somebody is in a dataset; without one, the most that they are anywhere. @param {string} [dataset] @returns {Role | null} null: nobody logs in here */
export function roleIn(dataset) {
	const { team, role, datasets = [], allows = {} } = me.value ?? {};
	if (!team || !role) return null;
	if (role === 'admin') return role;
	if (dataset) return datasets.find((one) => one.dataset === dataset)?.role ?? role;
	const ranks = /** @type {Role[]} */ (Object.keys(allows));
	return [role, ...datasets.filter(({ id }) => id <= COPIES).map((one) => one.role)].sort((a, b) => ranks.indexOf(b) - ranks.indexOf(a))[0];
}

/** Why somebody may not do that in a dataset; empty: they may. @param {Action} action @param {string} [dataset] */
export function whyNot(action, dataset) {
	const role = roleIn(dataset);
	const allows = me.value?.allows;
	if (role === null || !allows || allows[role]?.includes(action)) return '';
	const least = Object.keys(allows).find((name) => allows[/** @type {Role} */ (name)].includes(action));
	return `${ACTION_LABELS[action]} needs the role ${least}${dataset ? ` in ${dataset}` : ''}; yours is ${role}.`;
}

/** Say why something is not done. @param {Action} action @param {string} [dataset] @returns {boolean} whether it may not be */
export function refuses(action, dataset) {
	const why = whyNot(action, dataset);
	if (why) complain(why);
	return why !== '';
}
