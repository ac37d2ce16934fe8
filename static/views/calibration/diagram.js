// @ts-check
/** The pitch as a palette: every marking can be pointed at, chosen, given to what is in hand. */

import { html } from 'htm/preact';
import { useMemo, useRef } from 'preact/hooks';

import { pathFromAbove, pitchMarkings } from '../../geometry/pitch.js';
import { GLYPHS } from '../../geometry/residual.js';
import { plural } from '../../lib/format.js';
import { choice, hovered, lines, mode } from '../../state/calibration.js';
import { focusImage, pickMarking } from './actions.js';

/** @import {PitchPoint} from '../../geometry/camera.js' */
/** @import {Grade, MarkingResiduals} from '../../geometry/residual.js' */

/** Goals are unfolded behind the goal line, this much larger than they are. */
const GOAL_SCALE = 2.4;

/** @typedef {{name: string, d: string}} Shape */

/** @param {string} name @param {PitchPoint[]} polyline @param {number} half half the length */
function shapeOf(name, polyline, half) {
	const flat = polyline.map(([x, y, z]) => {
		if (!name.startsWith('Goal')) return [x, y];
		const side = Math.sign(x);
		return [side * (half + 1.2 - z * GOAL_SCALE), y * GOAL_SCALE];
	});
	return pathFromAbove(flat);
}

/** @param {number} length @param {number} width @returns {Shape[]} */
function shapesOf(length, width) {
	return [...pitchMarkings(length, width)].map(([name, polyline]) => ({ name, d: shapeOf(name, polyline, length / 2) }));
}

/** @param {Grade | undefined} grade @param {number} points */
function words(grade, points) {
	if (points === 0) return grade ? 'visible, not drawn' : 'outside this view';
	const state = { ok: 'fits', warn: 'fits badly', bad: 'does not fit', unseen: 'outside this view' }[grade ?? 'unseen'];
	return `${plural(points, 'point')}, ${state}`;
}

/** @param {{pitch: {length: number, width: number}, fits: MarkingResiduals[]}} props */
export function PitchDiagram({ pitch, fits }) {
	const shapes = useMemo(() => shapesOf(pitch.length, pitch.width), [pitch.length, pitch.width]);
	const svg = useRef(/** @type {SVGSVGElement | null} */ (null));
	const names = useMemo(() => shapes.map(({ name }) => name).sort(), [shapes]);
	const [l, w] = [pitch.length / 2, pitch.width / 2];
	const entry = choice.value?.marking ?? names[0];

	/** Arrows walk through the markings by name. @param {KeyboardEvent} event @param {string} name */
	function walk(event, name) {
		if (event.shiftKey || event.ctrlKey || event.altKey || event.metaKey) return;
		const step = /** @type {Record<string, number>} */ ({ ArrowRight: 1, ArrowDown: 1, ArrowLeft: -1, ArrowUp: -1 })[event.key];
		if (!step && event.key !== 'Enter' && event.key !== ' ') return;
		event.preventDefault();
		event.stopPropagation();
		if (!step) {
			pickMarking(name);
			// What comes next is done in the image: arrows move its points.
			focusImage();
			return;
		}
		const next = names[(names.indexOf(name) + step + names.length) % names.length];
		const shape = svg.current?.querySelector(`[data-marking="${CSS.escape(next)}"]`);
		if (shape instanceof SVGElement) shape.focus();
	}

	return html`
		<section class="card diagram" aria-label="Markings of the pitch" data-mode=${mode.value}>
			<h2>${mode.value === 'relabel' ? `Relabel ${choice.value?.marking} as…` : 'Markings'}
				<span class="card__aside">${hovered.value ?? choice.value?.marking ?? 'point at a marking'}</span>
			</h2>
			<svg ref=${svg} viewBox=${`${-l - 9} ${-w - 2} ${2 * l + 18} ${2 * w + 4}`} role="group" aria-label="The pitch from above, goals unfolded">
				<rect class="diagram__grass" x=${-l} y=${-w} width=${2 * l} height=${2 * w} />
				${shapes.map(({ name, d }) => {
					const fit = fits.find(({ marking }) => marking === name);
					const points = lines.value[name]?.length ?? 0;
					const state = points > 0 ? (fit?.grade ?? 'unseen') : fit ? 'visible' : 'absent';
					const said = words(fit?.grade, points);
					return html`
						<g
							key=${name} class="diagram__marking" role="button" data-marking=${name} data-state=${state}
							tabindex=${name === entry ? 0 : -1} aria-pressed=${choice.value?.marking === name}
							aria-label=${`${name}: ${said}`} data-lit=${hovered.value === name}
							onPointerEnter=${() => { hovered.value = name; }} onPointerLeave=${() => { hovered.value = null; }}
							onFocus=${() => { hovered.value = name; }} onBlur=${() => { hovered.value = null; }}
							onKeyDown=${(/** @type {KeyboardEvent} */ event) => walk(event, name)} onClick=${() => pickMarking(name)}
						>
							<title>${`${GLYPHS[fit?.grade ?? 'unseen']} ${name}: ${said}`}</title>
							<path class="diagram__reach" d=${d} /><path class="diagram__line" d=${d} />
						</g>`;
				})}
			</svg>
		</section>
	`;
}
