// @ts-check
/** The views in numbers. */

import { html } from 'htm/preact';

import { gradeOfSize } from '../geometry/residual.js';
import { fixed, percent, pixels } from '../lib/format.js';
import { submit } from '../state/group.js';
import { leftOutText } from '../state/reasons.js';
import { focused, focusView, residualLines } from '../state/workspace.js';
import { Letter } from './letter.js';
import { Term } from './term.js';
import { errorOf, gradesOf, jacOf, paintOf, unusedErrors } from './view_state.js';

/** @import {GroupDocument} from '../api/types.js' */
/** @import {ViewPicture} from '../overlays/scene.js' */

/** @param {ViewPicture} picture */
function expected({ ball }) {
	return ball?.optimized_diameter_px ?? null;
}

/** @param {{group: GroupDocument, pictures: ViewPicture[]}} props */
export function ViewTable({ group, pictures }) {
	return html`
		<section class="card" aria-label="Views in numbers">
			<h2>Views</h2>
			<table class="numbers">
				<thead>
					<tr>
						<th scope="col">view</th>
						<th scope="col"><${Term} word="jac">JaC<//></th>
						<th scope="col"><${Term} word="column:view_error">px<//></th>
						<th scope="col"><${Term} word="column:view_percent">%<//></th>
						<th scope="col"><${Term} word="column:view_diameter">Ø px<//></th>
						<th scope="col"><${Term} word="column:view_ratio">ratio<//></th>
						<th scope="col"><span class="hidden-text">included</span></th>
					</tr>
				</thead>
				<tbody>
					${pictures.map((picture) => html`<${ViewRow} key=${picture.view.key} group=${group} picture=${picture} />`)}
				</tbody>
			</table>
		</section>
	`;
}

/** A camera that no lines say how well it fits, over a picture that could. @param {ViewPicture} picture */
function isUnmeasured({ view, solved }) {
	return Boolean(view.image && solved?.calibration.camera) && Object.keys(view.lines).length === 0;
}

/** How the camera and the paint of its picture agree, where that was read, or the way to it. @param {{picture: ViewPicture}} props */
function PaintLine({ picture }) {
	const { solved, view, paint: read } = picture;
	const paint = paintOf(solved, read?.found);
	if (!paint && isUnmeasured(picture) && !residualLines.value) {
		return html`
			<tr class="numbers__aside" data-paint=${view.letter}>
				<td colspan="7">paint: not compared with the camera <button class="suggestion__more" type="button" data-needs="annotate" aria-label=${`Compare the camera of view ${view.letter} with its paint`} onClick=${() => { residualLines.value = true; }}>compare</button></td>
			</tr>`;
	}
	if (!paint) return null;
	return html`
		<tr class="numbers__aside" data-paint=${view.letter}>
			<td colspan="7">
				paint: <${Term} word="supported">supported<//> ${paint.supported} · <${Term} word="explained">explained<//> ${paint.explained}${paint.reason ? ` · ${paint.reason}` : ''}
			</td>
		</tr>
	`;
}

/** @param {{group: GroupDocument, picture: ViewPicture}} props */
function ViewRow({ group, picture }) {
	const { view, solved, ball } = picture;
	const grades = gradesOf(picture, group.policy);
	const error = errorOf(picture);
	const unused = unusedErrors(picture);
	return html`
		<tr data-row=${view.letter} data-focused=${focused.value === view.letter}>
			<th scope="row">
				<button class="row-button" type="button" title=${view.label} onClick=${() => focusView(view.letter)}>
					<${Letter} letter=${view.letter} /><span>${view.label}</span>
				</button>
			</th>
			<td data-grade=${grades.jac} data-number="jac">${fixed(jacOf(solved), 2)}</td>
			<td data-grade=${grades.error} data-number="error">${pixels(error.px)}</td>
			<td data-grade=${grades.error}>${percent(error.percent)}</td>
			<td>${pixels(expected(picture))}</td>
			<td data-grade=${gradeOfSize(ball?.size_ratio)} data-number="ratio">${fixed(ball?.size_ratio, 2)}</td>
			<td>
				<input
					type="checkbox" data-needs="annotate" checked=${view.included}
					aria-label=${`Include view ${view.letter}`} title="Use this view (Shift+digit)"
					onChange=${() => submit({ kind: 'include', view: view.key, included: !view.included })}
				/>
			</td>
		</tr>
		<${PaintLine} picture=${picture} />
		${view.proposed?.length ? html`
			<tr class="numbers__aside" data-proposed=${view.letter}>
				<td colspan="7">lines: ${view.proposed.length} of ${Object.keys(view.lines).length} accepted as <${Term} word="proposal">proposed<//></td>
			</tr>` : null}
		${unused ? html`
			<tr class="numbers__aside" data-unused=${view.letter}>
				<td colspan="7">ball of ${view.letter}, not used: ${unused}</td>
			</tr>` : null}
		${view.left_out ? html`
			<tr class="numbers__aside" data-why=${view.left_out.reason}>
				<td colspan="7">View ${view.letter} is ${leftOutText(view.left_out)}</td>
			</tr>` : null}
	`;
}
