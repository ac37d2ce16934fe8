// @ts-check
/** The objects of a view as a list: what the canvas shows, for keyboards and screen readers. */

import { html } from 'htm/preact';
import { useLayoutEffect, useRef } from 'preact/hooks';

import { ballOf } from '../geometry/preview.js';
import { pixelText, scoreText } from '../lib/format.js';
import { isFollowed } from '../state/edits.js';
import { objectsOf, sameObject } from '../state/tab_order.js';
import { boxes, editing, selected } from '../state/workspace.js';

/** @import {ViewPicture} from '../overlays/scene.js' */
/** @import {Selection} from '../state/workspace.js' */

/**
 * @param {ViewPicture} picture @param {Selection} object
 * @returns {{name: string, point: string, number: string, title?: string}}
 */
function wordsFor(picture, object) {
	if (object.kind === 'ball') {
		const ball = ballOf(picture.view);
		const size = ball?.box ? `Ø ${pixelText((ball.box[2] + ball.box[3]) / 2)}` : '';
		return { name: 'Ball', point: isFollowed(ball?.predicted_by) ? 'was followed' : ball?.predicted_by ? 'was predicted' : '', number: size, title: picture.predictions?.origin ?? undefined };
	}
	if (object.kind === 'prediction') {
		const mark = picture.predictions?.marks.find(({ id }) => id === object.prediction);
		return { name: `Predicted by ${mark?.name}`, point: mark?.sure ? '' : 'below threshold', number: mark ? scoreText(mark) : '', title: 'Y accepts it' };
	}
	const found = picture.markings.find(({ marking }) => marking === object.marking);
	const distance = found?.points[object.index]?.distance ?? null;
	const number = distance === null ? '' : pixelText(distance);
	return { name: object.marking, point: `point ${object.index + 1}`, number };
}

/** @param {{picture: ViewPicture, object: Selection}} props */
function ObjectButton({ picture, object }) {
	const { name, point, number, title } = wordsFor(picture, object);
	const select = () => { selected.value = object; };
	return html`
		<button type="button" title=${title} aria-pressed=${sameObject(object, selected.value)} onFocus=${select} onClick=${select}>
			<span>${name}</span><span>${point}</span><span>${number}</span>
		</button>
	`;
}

/** @param {{picture: ViewPicture, side: 'left' | 'right'}} props `side`: of the picture, without the selected object */
export function ObjectList({ picture, side }) {
	const list = useRef(/** @type {HTMLUListElement | null} */ (null));
	const objects = objectsOf(picture.view, boxes.value ? picture.predictions?.marks : []);
	// Before the next key: an arrow pressed right after Enter already moves the first object.
	useLayoutEffect(() => {
		const at = list.current?.querySelector('[aria-pressed="true"]') ?? list.current?.querySelector('button');
		if (at instanceof HTMLElement) at.focus();
	}, []);
	// What had the focus may have become something else: an accepted prediction is the ball.
	useLayoutEffect(() => {
		const at = document.activeElement === document.body ? list.current?.querySelector('[aria-pressed="true"]') : null;
		if (at instanceof HTMLElement) at.focus();
	}, [JSON.stringify(objects)]);
	return html`
		<ul class="object-list" data-side=${side} ref=${list} aria-label=${`Objects of view ${picture.view.letter}`}>
			${objects.length ? null : html`<li class="object-list__empty">Nothing is annotated here.</li>`}
			${objects.map((object) => html`
				<li key=${JSON.stringify(object)}><${ObjectButton} picture=${picture} object=${object} /></li>
			`)}
			<li><button type="button" onClick=${() => { editing.value = false; }}>Done</button></li>
		</ul>
	`;
}
