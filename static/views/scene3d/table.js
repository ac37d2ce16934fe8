// @ts-check
/** The 3D view in words, for those who do not see it. */

import { html } from 'htm/preact';

import { fixed, metres } from '../../lib/format.js';
import { Letter } from '../letter.js';

/** @import {PlacedBall, SceneValues, Stand} from './values.js' */

/** @param {{name: string, what: unknown, point: readonly number[], rest: string}} props */
function Row({ name, what, point, rest }) {
	return html`
		<tr data-thing=${name}>
			<th scope="row">${what}${rest ? html`<small>${rest}</small>` : null}</th>
			<td>${fixed(point[0], 2)}</td><td>${fixed(point[1], 2)}</td><td>${fixed(-point[2], 2)}</td>
		</tr>
	`;
}

/** @param {Stand} stand @param {SceneValues} scene */
function standText({ camera, used }, { best, ball }) {
	const point = (best ?? ball)?.point;
	const away = point ? `${metres(Math.hypot(...camera.C.map((value, i) => value - point[i])))} from the ball` : '';
	return [used ? '' : 'not used', away].filter(Boolean).join(', ');
}

/** @param {PlacedBall} ball */
function ballText({ sigma, ellipsoid }) {
	const size = ellipsoid ? `2σ ${ellipsoid.radii.map((radius) => fixed(radius, 2)).join(' × ')} m` : '';
	return [sigma === null ? '' : `σ ${metres(sigma)}`, size].filter(Boolean).join(', ');
}

/** @param {{scene: SceneValues}} props */
export function SceneTable({ scene }) {
	const { stands, pairs, ball, best } = scene;
	return html`
		<div class="scene3d__table" tabindex="0" role="group" aria-label="The scene in words">
			<table class="numbers">
				<thead>
					<tr>
						<th scope="col">metres</th><th scope="col">x</th><th scope="col">y</th><th scope="col">height</th>
					</tr>
				</thead>
				<tbody>
					${best ? html`<${Row} name="best" what="Most likely point ◆" point=${best.point} rest=${ballText(best)} />` : null}
					${ball ? html`<${Row} name="mean" what="Pair average ●" point=${ball.point} rest=${ballText(ball)} />` : null}
					${pairs.map(({ letters, point, valid }) => html`
						<${Row} key=${letters} name=${`pair ${letters}`} what=${`Pair ${letters} ${valid ? '○' : '×'}`} point=${point} rest=${valid ? '' : 'left out'} />`)}
					${stands.map((stand) => html`
						<${Row} key=${stand.letter} name=${`camera ${stand.letter}`} what=${html`<${Letter} letter=${stand.letter} /> <span>${stand.label}</span>`}
							point=${stand.camera.C} rest=${standText(stand, scene)} />`)}
					${stands.length ? null : html`<tr><td colspan="4">No view is calibrated: there is nothing to place.</td></tr>`}
				</tbody>
			</table>
		</div>
	`;
}
