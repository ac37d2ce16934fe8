// @ts-check
/** The objects of a view in the order in which Tab and the object list walk through them. */

import { boxCenter } from '../geometry/ball.js';
import { ballCenter, ballOf } from '../geometry/preview.js';

/** @import {ViewJson} from '../api/types.js' */
/** @import {ImagePoint} from '../geometry/camera.js' */
/** @import {Mark} from './prediction_marks.js' */
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

/**
 * Where an object is in the picture of its view; null where it is not there.
 *
 * @param {Selection} object @param {ViewJson} view @param {readonly Pick<Mark, 'id' | 'box'>[]} [marks] predictions that are drawn
 * @returns {ImagePoint | null}
 */
export function placeOf(object, view, marks = []) {
	if (object.kind === 'point') return view.lines[object.marking]?.[object.index] ?? null;
	if (object.kind === 'prediction') {
		const box = marks.find(({ id }) => id === object.prediction)?.box;
		return box ? boxCenter(box) : null;
	}
	const ball = ballOf(view);
	return (ball && ballCenter(ball)) ?? null;
}
