// @ts-check
/** The frames behind a number; each opens its group. */

import { html } from 'htm/preact';
import { useEffect, useRef, useState } from 'preact/hooks';

import { getFrames } from '../../api/evaluations.js';
import { ApiError, sentenceOf } from '../../api/problem.js';
import { count, fixed } from '../../lib/format.js';
import { matchName } from '../../lib/match_name.js';
import { reviewAddress } from '../../state/navigation.js';
import { number } from './cell.js';

/** @import {FrameJson, FrameQuery} from '../../api/evaluations.js' */

/** @typedef {{field: string, label: string}} Column */

/** @type {Column[]} */
const COLUMNS = [
	{ field: 'score', label: 'score' }, { field: 'iou', label: 'IoU' }, { field: 'error_m', label: 'error, m' },
	{ field: 'error_percent', label: 'error, %' }, { field: 'distance_m', label: 'distance, m' },
	{ field: 'diameter_px', label: 'Ø, px' }, { field: 'parallax_degrees', label: 'β, °' }, { field: 'predicted_jac', label: 'predicted JaC' },
];
/** Those of the number that was clicked; the first is the number itself. @type {{[field: string]: Column[]}} */
const ASKED = {
	detections: [{ field: 'detections', label: 'detections' }],
	hit_iou: [{ field: 'hit_iou', label: 'IoU of the box that counts as found' }],
	size_error_percent: [{ field: 'size_error_percent', label: 'size error, %' }],
	any_error_m: [{ field: 'any_error_m', label: 'error of the detection with the highest score, m' }],
	predicted_error_m: [{ field: 'predicted_error_m', label: 'predicted camera: error, m' }, { field: 'predicted_error_percent', label: 'predicted camera: error, %' }],
	predicted_any_error_m: [{ field: 'predicted_any_error_m', label: 'predicted camera: error of the detection with the highest score, m' }],
	box_iou: [{ field: 'box_iou', label: 'IoU of the dataset’s box with the reference box' }],
};

/** The clicked number first, then those that some frame has. @param {string} field @param {FrameJson[]} items */
function columnsOf(field, items) {
	const asked = ASKED[field] ?? COLUMNS.filter((column) => column.field === field);
	const others = COLUMNS.filter((column) => !asked.includes(column) && items.some((frame) => frame[column.field] !== null && frame[column.field] !== undefined));
	return [...asked, ...others];
}

/** @param {{frame: FrameJson, columns: Column[]}} props */
function Row({ frame, columns }) {
	const { name, aside } = matchName(frame.group);
	return html`
		<tr>
			<th scope="row">${frame.group_id > 0 ? html`<a href=${reviewAddress(frame.group_id, '')}>${name}</a>` : name}<small>${[`view ${frame.view}`, aside].filter(Boolean).join(' · ')}</small></th>
			${columns.map(({ field }) => html`<td key=${field} data-numeric="true">${frame[field] === null || frame[field] === undefined ? '–' : number(frame[field])}</td>`)}
		</tr>
	`;
}

/** Pages of frames. @param {number} evaluation @param {FrameQuery} query */
function useFrames(evaluation, query) {
	const [state, setState] = useState(/** @type {{items: FrameJson[], next: string | null, total: number, error: ApiError | null}} */ ({ items: [], next: null, total: 0, error: null }));
	const asking = useRef(new AbortController());
	/** @param {FrameJson[]} before @param {string | null} cursor */
	async function read(before, cursor) {
		// Another number, or the same page once more: only what was asked last counts.
		asking.current.abort();
		const { signal } = asking.current = new AbortController();
		try {
			const found = await getFrames(evaluation, { ...query, cursor }, signal);
			if (signal.aborted) return;
			setState({ items: [...before, ...found.items], next: found.next, total: found.total, error: null });
		} catch (error) {
			if (signal.aborted) return;
			if (!(error instanceof ApiError)) throw error;
			setState((old) => ({ ...old, error }));
		}
	}
	useEffect(() => {
		read([], null);
		return () => asking.current.abort();
	}, [evaluation, JSON.stringify(query)]);
	return { ...state, more: () => read(state.items, state.next) };
}

/** @param {{evaluation: number, query: FrameQuery, title: string, sort: (sort: string) => void, onClose: () => void}} props */
export function FramesCard({ evaluation, query, title, sort, onClose }) {
	const { items, next, total, error, more } = useFrames(evaluation, query);
	const columns = columnsOf(query.field ?? '', items);
	/** @param {string} field */
	const turn = (field) => sort(query.sort === `${field}-desc` ? field : `${field}-desc`);
	return html`
		<section class="card card--flush" aria-labelledby="frames-title">
			<h2 id="frames-title">Frames · ${title} <span class="card__aside">${count(total)} <button class="link-button" type="button" onClick=${onClose}>Close<span class="hidden-text"> the frames</span></button></span></h2>
			${error ? html`<p class="form__error" role="alert">${sentenceOf(error)}</p>` : null}
			<div class="table__scroll" tabindex="0" role="region" aria-label=${`Frames, ${title}`}>
				<table class="table">
					<thead><tr><th>group and view</th>${columns.map(({ field, label }) => html`
						<th key=${field} data-numeric="true" aria-sort=${query.sort === field ? 'ascending' : query.sort === `${field}-desc` ? 'descending' : 'none'}><button class="table__sort" type="button" onClick=${() => turn(field)}>${label}${query.sort === field ? ' ↑' : query.sort === `${field}-desc` ? ' ↓' : ''}</button></th>`)}</tr></thead>
					<tbody>${items.map((frame) => html`<${Row} key=${frame.frame_id} frame=${frame} columns=${columns} />`)}</tbody>
				</table>
			</div>
			${next ? html`<p class="yield__note"><button class="button" type="button" onClick=${more}>More frames</button> ${fixed(items.length, 0)} of ${count(total)}</p>` : null}
		</section>
	`;
}
