// @ts-check
/** Projected markings, coloured and dashed by how far the annotation is off. */

import { piecesOf } from '../geometry/polyline.js';
import { DASHES } from '../geometry/residual.js';
import { colours } from '../lib/colours.js';
import { strokeLines } from './pen.js';

/** @import {Scene} from './scene.js' */

/** @param {CanvasRenderingContext2D} context @param {Scene} scene */
export function drawMarkings(context, { picture, viewport, selected }) {
	for (const { marking, grade, polyline } of picture.markings) {
		const chosen = selected?.kind === 'point' && selected.marking === marking
			&& selected.view === picture.view.key;
		strokeLines(context, viewport, piecesOf(polyline, picture.view), {
			colour: colours.value[grade],
			width: grade === 'unseen' ? 1.25 : chosen ? 3 : 2,
			dash: DASHES[grade],
			halo: grade !== 'unseen',
		});
	}
}
