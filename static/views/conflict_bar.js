// @ts-check
/** Whose edit counts: before, theirs and mine of everything that I changed. It blocks nothing. */

import { html } from 'htm/preact';

import { ballCenter } from '../geometry/preview.js';
import { pixelText } from '../lib/format.js';
import { conflict, keepMine, mergeBoth, takeTheirs } from '../state/conflict.js';
import { leftOutText } from '../state/reasons.js';

/** @import {BallJson, LeftOutJson} from '../api/types.js' */
/** @import {Field, Marked} from '../state/conflict.js' */

/**
 * One side of a field, in words.
 *
 * @param {Field} field @param {any} value @param {any} base
 * @returns {string}
 */
function wordsFor(field, value, base) {
	if (field.kind === 'verdict') return value?.state ?? '';
	if (field.kind === 'include') return includedWords(value);
	if (field.kind === 'picture') return value ? 'stretched or cropped' : 'as it was taken';
	if (field.kind === 'ball') return ballWords(value?.[0], base?.[0]);
	return lineWords(value, base);
}

/** @param {{included: boolean, left_out: LeftOutJson | null} | undefined} value */
function includedWords(value) {
	if (!value) return '';
	return value.included ? 'used' : leftOutText(value.left_out);
}

/** @param {BallJson | undefined} ball @param {BallJson | undefined} base */
function ballWords(ball, base) {
	const center = ball && ballCenter(ball);
	if (!ball || !center) return ball?.out_of_view ? 'out of view' : 'no ball';
	const size = ball.box ? `Ø ${pixelText((ball.box[2] + ball.box[3]) / 2)}` : 'point';
	const from = base && base !== ball ? ballCenter(base) : null;
	const moved = from ? Math.hypot(center.x - from.x, center.y - from.y) : 0;
	const hidden = ball.occluded ? ', occluded' : '';
	return `${size}${moved > 0.005 ? `, moved ${pixelText(moved)}` : ''}${hidden}`;
}

/** @param {Marked} marked @param {Marked | null} base */
function lineWords({ points, hidden }, base) {
	if (!points) return hidden ? 'not visible' : 'not drawn';
	const count = `${points.length} ${points.length === 1 ? 'point' : 'points'}`;
	const before = base?.points;
	if (before?.length !== points.length) return count;
	const moved = Math.max(...points.map((point, i) => Math.hypot(point.x - before[i].x, point.y - before[i].y)));
	return moved > 0.005 ? `${count}, moved ${pixelText(moved)}` : count;
}

/** @param {{field: Field}} props */
function FieldRow({ field }) {
	return html`
		<tr data-overlaps=${field.overlaps}>
			<th scope="row">${field.name}</th>
			<td>${wordsFor(field, field.base, null)}</td>
			<td>${wordsFor(field, field.theirs, field.base)}</td>
			<td>${field.unchanged ? 'unchanged' : wordsFor(field, field.mine, field.base)}</td>
			<td>${field.unchanged ? 'only they changed it' : field.overlaps ? 'both changed it' : 'only you changed it'}</td>
		</tr>
	`;
}

export function ConflictBar() {
	const present = conflict.value;
	if (!present) return null;
	const drawn = present.fields.some(({ kind, unchanged }) => !unchanged && (kind === 'ball' || kind === 'lines'));
	return html`
		<section class="bar conflict" data-tone="warn" role="alert" aria-label="Conflict">
			<div class="conflict__words">
				<p><strong>Another person changed this group first.</strong> ${drawn ? 'Their version is shown solid, yours dotted. ' : ''}Choose which to keep.</p>
				<table class="conflict__fields">
					<thead><tr><th scope="col">what</th><th scope="col">before</th><th scope="col">theirs</th><th scope="col">yours</th><th scope="col"><span class="hidden-text">overlap</span></th></tr></thead>
					<tbody>${present.fields.map((field) => html`<${FieldRow} key=${field.key} field=${field} />`)}</tbody>
				</table>
			</div>
			<button class="button button--primary" type="button" onClick=${keepMine}>Keep mine</button>
			<button class="button" type="button" onClick=${takeTheirs}>Take theirs</button>
			${present.mergeable ? html`<button class="button" type="button" onClick=${mergeBoth}>Keep both, theirs where they overlap</button>` : null}
		</section>
	`;
}
