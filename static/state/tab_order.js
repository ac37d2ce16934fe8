// @ts-check
/** The objects of a view in the order in which Tab and the object list walk through them. */

import { ballOf } from '../geometry/preview.js';

/** @import {ViewJson} from '../api/types.js' */
/** @import {Selection} from './workspace.js' */

/**
 * @param {ViewJson} view @param {readonly {id: number}[]} [marks] predictions that are drawn
 * @returns {Selection[]} the ball first, then what was predicted, then the points of every marking
 */
export function objectsOf(view, marks = []) {
	/** @type {Selection[]} */
	const objects = ballOf(view) ? [{ kind: 'ball', view: view.key }] : [];
	for (const { id } of marks) objects.push({ kind: 'prediction', view: view.key, prediction: id });
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
	if (a.kind === 'point' && b.kind === 'point') return a.marking === b.marking && a.index === b.index;
	return a.kind === 'ball' || (a.kind === 'prediction' && b.kind === 'prediction' && a.prediction === b.prediction);
}
