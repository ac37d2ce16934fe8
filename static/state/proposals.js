// @ts-check
/** Lines that are proposed for the views of the group on screen; they count for nothing until accepted. */

import { computed, effect, signal, untracked } from '@preact/signals';

import { getGroupProposals } from '../api/proposals.js';
import { ApiError } from '../api/problem.js';
import { plural } from '../lib/format.js';
import { page } from '../lib/router.js';
import { group, groupDocument, submit } from './group.js';
import { announce, complain } from './notice.js';
import { bareViews, isBare } from './proposal_lines.js';
import { focused, overlaysHidden } from './workspace.js';

/** @import {ViewProposalJson} from '../api/proposals.js' */
/** @import {ViewJson} from '../api/types.js' */

/** How long a group stands before it is asked about, ms. */
const PAUSE = 120;
const PAGES = ['review', 'calibration'];

const answered = signal(/** @type {{group: number, items: ViewProposalJson[]} | null} */ (null));

/** What is proposed for views of the group on screen that have no lines, by key of the view. */
export const proposals = computed(() => {
	const [at, known] = [group.value, answered.value];
	if (!at || known?.group !== at.id) return new Map();
	const bare = new Set(at.views.filter(isBare).map(({ id }) => id));
	return new Map(/** @type {[string, ViewProposalJson][]} */ (known.items.filter(({ view }) => bare.has(view)).map((item) => [item.key, item])));
});

/** @type {ReturnType<typeof setTimeout> | undefined} */
let timer;
let controller = new AbortController();

/** Ask about groups with views without lines, for as long as a page shows them. @returns {() => void} */
export function followProposals() {
	const wanted = computed(() => {
		const at = groupDocument.value;
		return at && PAGES.includes(page.value.page) && bareViews(at).length > 0 ? at.id : null;
	});
	const stop = effect(() => {
		const id = wanted.value;
		untracked(() => {
			leave();
			if (id !== null) timer = setTimeout(ask, PAUSE, id, controller.signal);
		});
	});
	return () => { stop(); leave(); };
}

function leave() {
	clearTimeout(timer);
	controller.abort();
	controller = new AbortController();
}

/** @param {number} id @param {AbortSignal} abort */
async function ask(id, abort) {
	try {
		const { items } = await getGroupProposals(id, abort);
		if (!abort.aborted) answered.value = { group: id, items };
	} catch (error) {
		// The server is away, or another group came: the group can be worked on without.
		if (!abort.aborted && !(error instanceof ApiError)) throw error;
	}
}

/** Make the proposed lines of a view its lines. @param {ViewJson} view */
export function acceptProposal(view) {
	const item = proposals.peek().get(view.key);
	if (!item) announce(isBare(view) ? `Nothing was proposed for view ${view.letter} yet: Statistics has the button that looks.` : `View ${view.letter} has lines already.`);
	else if (item.outcome !== 'proposed') complain(`No lines are proposed for view ${view.letter}. ${item.sentence}`);
	else if (overlaysHidden.value) complain('What is proposed is hidden. H shows what you would accept.');
	else {
		const names = Object.keys(item.lines);
		submit({ kind: 'lines', view: view.key, lines: item.lines, proposed: names });
		announce(`${plural(names.length, 'marking')} of view ${view.letter} accepted as proposed. Undo takes them back; M swaps the sides.`);
	}
}

/** Accept what is proposed for the view in hand. */
export function acceptFocused() {
	const view = group.value?.views.find(({ letter }) => letter === focused.value);
	if (view) acceptProposal(view);
}
