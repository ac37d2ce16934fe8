// @ts-check
/** The objects of a view in the order in which Tab and the object list walk through them. */

import { ballOf } from '../geometry/preview.js';

/** @import {ViewJson} from '../api/types.js' */
/** @import {Selection} from './workspace.js' */

/**
 * @param {ViewJson} view
 * @returns {Selection[]} the ball first, then the points of every marking
 */
export function objectsOf(view) {
	/** @type {Selection[]} */
	const objects = ballOf(view) ? [{ kind: 'ball', view: view.key }] : [];
	for (const marking of Object.keys(view.lines).sort()) {
		view.lines[marking].forEach((_, index) => {
			objects.push({ kind: 'point', view: view.key, marking, index });
		});
	}
	return objects;
}

/** @param {Selection | null} a @param {Selection | null} b */
export function sameObject(a, b) {
	if (!a || !b || a.kind !== b.kind || a.view !== b.view) return false;
	return a.kind === 'ball' || b.kind === 'ball' || (a.marking === b.marking && a.index === b.index);
}
