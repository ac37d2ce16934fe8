// @ts-check
/** The timeline of static cameras: error over frames, to scrub, play and jump in. */

import { html } from 'htm/preact';
import { useCallback, useEffect, useMemo, useRef, useState } from 'preact/hooks';

import { diagonal } from '../../geometry/preview.js';
import { Canvas } from '../../lib/canvas.js';
import { colours } from '../../lib/colours.js';
import { count, metres, pixelText } from '../../lib/format.js';
import { useSize } from '../../lib/hooks.js';
import { groupDocument } from '../../state/group.js';
import { trackAround } from '../../state/group_track.js';
import {
	columns, goToWorst, keepInSight, playing, position, scrubTo, span, startTimeline, togglePlaying, trouble, zoomSpan,
} from '../../state/timeline.js';
import { GATE_TITLES } from '../gate_names.js';
import { drawCurve, toIndex } from './drawing.js';

/** @import {TrackAround} from '../../api/tracks.js' */
/** @import {TimelineJson} from '../../api/timeline.js' */
/** @import {Look} from './drawing.js' */

/** @returns {Look} */
function look() {
	const style = getComputedStyle(document.documentElement);
	/** @param {string} name */
	const get = (name) => style.getPropertyValue(`--${name}`).trim();
	return {
		ok: get('ok'), warn: get('warn'), bad: get('bad'), muted: get('muted'), ink: get('ink'), grid: get('line'),
		head: get('focus'),
	};
}

/** Why a group fails, in words. @param {string | null} gate that fails first */
function failure(gate) {
	const title = GATE_TITLES[gate ?? ''] ?? (gate ?? '').replaceAll('_', ' ');
	return title.charAt(0).toLowerCase() + title.slice(1);
}

/** One group in words. @param {TimelineJson} all @param {number} index */
function words(all, index) {
	const frame = all.frame[index] ?? all.number[index];
	const verdict = all.status[index] === 'unreviewed' ? '' : `, ${all.status[index]}${all.stale[index] ? ', stale' : ''}`;
	const passes = all.passes[index];
	const state = passes === null ? 'not solved' : passes ? 'passes' : `fails: ${failure(all.gate[index])}`;
	const error = all.error_px[index];
	const point = all.point[index];
	const place = point ? `, ${metres(-point[2])} high` : '';
	return `Frame ${frame}: ${error === null ? 'no error' : pixelText(error)}, ${state}${place}${verdict}`;
}

const STEPS = /** @type {Record<string, number>} */ ({
	ArrowRight: 1, ArrowUp: 1, ArrowLeft: -1, ArrowDown: -1, PageUp: 25, PageDown: -25, Home: -Infinity, End: Infinity,
});

/** How far the track is from balls that it was made without, around the frame on screen and by index; empty until something was edited. @param {TimelineJson} all @param {TrackAround | null} around @returns {Map<number, number>} */
function leftOutOf(all, around) {
	const found = new Map();
	around?.group.forEach((id, place) => {
		const [index, px] = [id === null ? -1 : all.id.indexOf(id), around.left_out_px[place]];
		if (index >= 0 && px !== null) found.set(index, px);
	});
	return found;
}

/** @param {{all: TimelineJson, limit: number}} props */
function Curve({ all, limit }) {
	const [ref, size] = useSize();
	const [pointed, setPointed] = useState(-1);
	const held = useRef(false);
	const shown = span.value ?? { from: 0, to: all.id.length - 1 };
	const at = position.value;
	const theme = colours.value;
	const around = trackAround.value;
	const leftOut = useMemo(() => leftOutOf(all, around), [all, around]);
	const draw = useCallback((/** @type {CanvasRenderingContext2D} */ context) => {
		drawCurve(context, size, { columns: all, span: shown, limit, position: at, leftOut }, look());
	}, [leftOut, all, shown.from, shown.to, limit, at, size.width, size.height, theme]);
	const wheeled = useRef({ shown, width: size.width });
	wheeled.current = { shown, width: size.width };

	useEffect(() => {
		const element = /** @type {HTMLElement} */ (ref.current);
		/** @param {WheelEvent} event */
		function wheel(event) {
			event.preventDefault();
			const x = event.clientX - element.getBoundingClientRect().left;
			zoomSpan(Math.exp(event.deltaY * 0.0016), toIndex(wheeled.current.shown, wheeled.current.width, x));
		}
		element.addEventListener('wheel', wheel, { passive: false });
		return () => element.removeEventListener('wheel', wheel);
	}, []);

	/** @param {PointerEvent} event */
	function indexOf(event) {
		const element = /** @type {HTMLElement} */ (ref.current);
		const x = event.clientX - element.getBoundingClientRect().left;
		return Math.min(all.id.length - 1, Math.max(0, toIndex(shown, size.width, x)));
	}

	/** @param {PointerEvent} event */
	function down(event) {
		held.current = true;
		/** @type {HTMLElement} */ (ref.current).setPointerCapture(event.pointerId);
		scrubTo(indexOf(event));
	}

	/** @param {PointerEvent} event */
	function move(event) {
		setPointed(indexOf(event));
		if (held.current) scrubTo(indexOf(event));
	}

	/** @param {KeyboardEvent} event */
	function key(event) {
		const step = STEPS[event.key];
		if (!step || event.ctrlKey || event.altKey || event.metaKey) return;
		event.preventDefault();
		scrubTo(at + step);
	}

	const release = () => { held.current = false; };
	return html`
		<p class="timeline__words">${pointed >= 0 && pointed < all.id.length ? words(all, pointed) : at >= 0 ? words(all, at) : ''}</p>
		<div
			class="timeline__curve" ref=${ref} role="slider" tabindex="0" aria-label="Frame" aria-valuemin="1"
			aria-valuemax=${all.id.length} aria-valuenow=${at + 1} aria-valuetext=${at >= 0 ? words(all, at) : 'not in this match'}
			onPointerDown=${down} onPointerMove=${move} onPointerUp=${release} onPointerCancel=${release}
			onPointerLeave=${() => setPointed(-1)} onKeyDown=${key}
		><${Canvas} width=${size.width} height=${size.height} draw=${draw} name="" /></div>
	`;
}

/** The numbers of the whole match, in words. @param {TimelineJson} all */
function totals(all) {
	const passing = all.passes.filter((passes) => passes === true).length;
	const open = all.passes.filter((passes) => passes === null).length;
	return `${count(passing)} of ${count(all.total)} pass${open ? `, ${count(open)} not solved yet` : ''}`;
}

export function Timeline() {
	useEffect(() => startTimeline(), []);
	const all = columns.value;
	const at = position.value;
	useEffect(() => keepInSight(at), [at]);
	const group = groupDocument.value;
	const first = group?.views[0];
	const limit = group && first ? (group.policy.tau_percent / 100) * diagonal(first) : 1;
	return html`
		<section class="card strip-card timeline" aria-label="Timeline" data-loaded=${all !== null} data-playing=${playing.value}>
			<h2>Reprojection error, frame by frame<span class="card__aside">${all ? totals(all) : ''}</span></h2>
			<div class="timeline__tools" role="toolbar" aria-label="Timeline">
				<button class="button" type="button" aria-pressed=${playing.value} onClick=${togglePlaying}>${playing.value ? 'Stop' : 'Play'} <kbd>Space</kbd></button>
				<button class="button" type="button" title="The frame with the largest reprojection error; press again for the next" onClick=${goToWorst}>Worst frame <kbd>J</kbd></button>
				<button class="button" type="button" aria-label="Zoom in" title="Zoom in (wheel)" onClick=${() => zoomSpan(0.5)}>+</button>
				<button class="button" type="button" aria-label="Zoom out" title="Zoom out (wheel)" onClick=${() => zoomSpan(2)}>−</button>
				${trackAround.value ? html`<span class="timeline__track"><span aria-hidden="true">◆</span> left-out error of the track, with the groups as they are now</span>` : null}
				<span class="timeline__key"><span aria-hidden="true">- -</span> limit ${pixelText(limit)}</span>
			</div>
			${all && all.id.length > 0 ? html`<${Curve} all=${all} limit=${limit} />` : html`<p class="empty-note" role="status">${trouble.value || 'Loading the frames…'}</p>`}
		</section>
	`;
}
