// @ts-check
/** A recording as a strip: its shots in proportion to their length, and a picture of each. */

import { html } from 'htm/preact';
import { useEffect, useRef } from 'preact/hooks';

import { frameAddress } from '../../api/recordings.js';
import { wanted } from '../../state/playback.js';
import { clockOf, kindOf, lengthText, timecode } from '../../state/shots.js';
import { BallBand } from './ball_card.js';

/** @import {RecordingJson, Shot} from '../../api/recordings.js' */
/** @import {Balls} from './ball_state.js' */

const THUMBNAIL = 160;
const STEPS = /** @type {Record<string, number>} */ ({ PageUp: 25, PageDown: -25, Home: -Infinity, End: Infinity });

/** @param {{one: RecordingJson, shots: Shot[], chosen: ReadonlySet<number>, balls: Balls, goTo: (frame: number) => void}} props */
function Bar({ one, shots, chosen, balls, goTo }) {
	const held = useRef(false);
	const frames = one.frames ?? 1;
	/** @param {number} frame */
	const place = (frame) => `${(100 * frame) / frames}%`;
	/** @param {PointerEvent} event */
	function frameOf(event) {
		const { left, width } = /** @type {HTMLElement} */ (event.currentTarget).getBoundingClientRect();
		return ((event.clientX - left) / width) * frames;
	}
	/** @param {PointerEvent} event */
	function down(event) {
		held.current = true;
		/** @type {HTMLElement} */ (event.currentTarget).setPointerCapture(event.pointerId);
		goTo(Math.floor(frameOf(event)));
	}
	/** @param {PointerEvent} event */
	function move(event) {
		if (held.current) goTo(Math.floor(frameOf(event)));
	}
	/** @param {KeyboardEvent} event */
	function key(event) {
		const step = STEPS[event.key];
		if (!step || event.ctrlKey || event.altKey || event.metaKey) return;
		event.preventDefault();
		goTo(Math.min(Math.max(wanted.value + step, 0), frames - 1));
	}
	const release = () => { held.current = false; };
	return html`
		<div
			class="film__bar" role="slider" tabindex="0" aria-label="Frame" aria-valuemin="0" aria-valuemax=${frames - 1} aria-valuenow=${wanted.value}
			aria-valuetext=${`frame ${wanted.value}, ${timecode(clockOf(shots, one.fps ?? 25)(wanted.value), one.fps ?? 25)}`}
			onPointerDown=${down} onPointerMove=${move} onPointerUp=${release} onPointerCancel=${release} onKeyDown=${key}
		>
			${shots.map((shot) => html`<span key=${shot.first} class="film__stretch" data-kind=${shot.kind} data-dropped=${shot.kept === false} style=${{ left: place(shot.first), width: place(shot.last - shot.first + 1) }}></span>`)}
			<${BallBand} runs=${balls.runs} all=${balls.all} first=${0} frames=${frames} />
			${[...chosen].map((frame) => html`<span key=${`i${frame}`} class="film__instant" style=${{ left: place(frame + 0.5) }}></span>`)}
			<span class="film__head" style=${{ left: place(wanted.value + 0.5) }}></span>
		</div>
	`;
}

/** @param {{one: RecordingJson, shot: Shot, index: number, current: boolean, go: () => void}} props */
function Item({ one, shot, index, current, go }) {
	const ref = useRef(/** @type {HTMLButtonElement | null} */ (null));
	const fps = one.fps ?? 25;
	useEffect(() => {
		const list = ref.current?.closest('.film__shots');
		if (!current || !ref.current || !list) return;
		// Only the list moves: where the page scrolls, the picture stays in sight.
		const [item, seen] = [ref.current.getBoundingClientRect(), list.getBoundingClientRect()];
		list.scrollLeft += Math.min(item.left - seen.left, 0) + Math.max(item.right - seen.right, 0);
	}, [current]);
	const middle = Math.floor((shot.first + shot.last) / 2);
	return html`
		<li>
			<button class="film__shot" type="button" ref=${ref} data-kind=${shot.kind} data-dropped=${shot.kept === false} aria-current=${current ? 'true' : undefined} onClick=${go}>
				<img src=${frameAddress(one, middle, THUMBNAIL)} alt="" loading="lazy" width="120" height="68" />
				<span class="film__words">
					<span class="film__letter" data-kind=${shot.kind} aria-hidden="true">${kindOf(shot.kind).letter}</span>
					<span><span class="hidden-text">Shot ${index + 1}: ${kindOf(shot.kind).label}, ${shot.kept === null ? '' : shot.kept ? 'kept, ' : 'dropped, '}</span>${lengthText((shot.last - shot.first + 1) / fps)}</span>
					${shot.kept === null ? null : html`<span aria-hidden="true">${shot.kept ? '✓' : '✕'}</span>`}
				</span>
			</button>
		</li>
	`;
}

/** @param {{one: RecordingJson, shots: Shot[], at: number, chosen: ReadonlySet<number>, balls: Balls, goTo: (frame: number) => void}} props */
export function Strip({ one, shots, at, chosen, balls, goTo }) {
	return html`
		<section class="card film__strip" aria-label="Shots">
			<${Bar} one=${one} shots=${shots} chosen=${chosen} balls=${balls} goTo=${goTo} />
			<ol class="film__shots" tabindex="-1">
				${shots.map((shot, index) => html`<${Item} key=${shot.first} one=${one} shot=${shot} index=${index} current=${index === at} go=${() => goTo(shot.first)} />`)}
			</ol>
		</section>
	`;
}
