// @ts-check
/** Findings that a person has checked and found to be fine: dismissed, opened again, undone like a verdict. */

import { group, solution, submitDismissal } from './group.js';
import { did, didAgain, forget, tookBack } from './last_action.js';
import { shownFinding } from './suggestions.js';
import { returnTo } from './navigation.js';
import { announce, complain, explain } from './notice.js';
import { openFindings } from './open_findings.js';

/** @import {DismissalDone} from './last_action.js' */
/** @import {FindingJson} from '../api/types.js' */

/** @param {FindingJson} finding */
function nameOf({ kind, view, marking, suggested, number }) {
	return { kind, view, marking, suggested, number };
}

/** Say that a finding was checked, or (`dismissed` false) that it is to be looked at again. @param {FindingJson} finding @param {boolean} dismissed */
export function dismiss(finding, dismissed) {
	const at = group.value;
	if (!at || !submitDismissal(nameOf(finding), dismissed)) return;
	did({ kind: 'dismissal', dataset: at.dataset.name, group: at.id, number: at.number, finding: nameOf(finding), dismissed });
	announce(dismissed ? 'Finding dismissed.' : 'Finding reopened.');
}

/** Dismiss the finding that the card speaks about, else the first that is open. */
export function dismissShown() {
	const finding = shownFinding.value ?? openFindings(solution.value)[0];
	if (finding) dismiss(finding, true);
	else explain('No finding is open in this group.');
}

/** Return to the group and do the opposite of what was done. @param {DismissalDone} action */
export async function undoDismissal(action) {
	forget(action);
	if (!(await returnTo(action.group))) return;
	if (submitDismissal(action.finding, !action.dismissed)) {
		tookBack(action);
		announce(action.dismissed ? 'Finding reopened.' : 'Finding dismissed again.');
	} else complain(`The finding of group ${action.number} was not changed.`);
}

/** Do again what was taken back. @param {DismissalDone} action */
export async function dismissAgain(action) {
	if (!(await returnTo(action.group)) || !submitDismissal(action.finding, action.dismissed)) return;
	didAgain(action);
	announce(action.dismissed ? 'Finding dismissed again.' : 'Finding reopened.');
}
