// @ts-check
/** Somebody else was first: whose edit counts. */

import { conflict, save, submit, takeOver } from './group.js';
import { announce } from './notice.js';

/** Make my edit again on top of theirs. */
export function keepMine() {
	const present = conflict.value;
	if (!present) return;
	conflict.value = null;
	takeOver(present.theirs);
	submit(present.edit);
}

/** Drop my edit and go on with theirs. */
export function takeTheirs() {
	const present = conflict.value;
	if (!present) return;
	conflict.value = null;
	takeOver(present.theirs);
	save.value = { state: 'saved', at: save.value.at };
	announce('Your edit was dropped.');
}
