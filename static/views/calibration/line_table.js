// @ts-check
/** Every marking of the view in numbers: how far off it is, and what the camera would be without it. */

import { html } from 'htm/preact';

import { diagonal } from '../../geometry/preview.js';
import { GLYPHS } from '../../geometry/residual.js';
import { fixed, pixelText, pixels } from '../../lib/format.js';
import { changed, choice, hovered } from '../../state/calibration.js';
import { Undrawn } from '../view_lines.js';
import { pickMarking } from './actions.js';

/** @import {InfluenceJson} from '../../api/calibration.js' */
/** @import {MarkingResiduals} from '../../geometry/residual.js' */
/** @import {ViewPicture} from '../../overlays/scene.js' */

/** The bar ends at two per cent of the diagonal, the widest threshold of JaC. */
const WIDEST = 0.02;
/** Below this a change of JaC is nothing to speak of. */
const WORTH = 0.005;

/** @param {{fit: MarkingResiduals, widest: number}} props widest: pixels */
function Bar({ fit, widest }) {
	const share = fit.largest === null ? 0 : Math.min(1, fit.largest / widest);
	return html`
		<svg class="jac-bar" viewBox="0 0 100 10" preserveAspectRatio="none" aria-hidden="true">
			<rect class="jac-bar__ground" width="100" height="10" />
			<rect class="jac-bar__value" width=${Math.max(1, 100 * share)} height="10" data-grade=${fit.grade} />
			<path class="jac-bar__tick" d="M25 0v10M50 0v10" />
		</svg>
	`;
}

/** What leaving a marking out does to the camera. @param {InfluenceJson | undefined} influence */
function influenceOf(influence) {
	const before = influence?.jac?.['0.5'];
	if (!influence || before === undefined) return { text: '', grade: 'unseen', title: 'not known' };
	const after = influence.jac_without?.['0.5'];
	if (after === undefined) return { text: 'needed', grade: 'unseen', title: 'Without this line, the others do not determine a camera' };
	const gained = after - before;
	const text = Math.abs(gained) < WORTH ? '±0' : `${gained > 0 ? '+' : '−'}${Math.abs(gained).toFixed(2)}`;
	const far = influence.largest_px_without;
	const own = far === null ? '' : `; this line is then ${pixelText(far)} off`;
	const title = `Without this line: JaC 0.5 % ${before.toFixed(2)} → ${after.toFixed(2)}${own}`;
	return { text, grade: gained > WORTH ? 'warn' : 'unseen', title };
}

/** @param {{fit: MarkingResiduals, widest: number, influence: InfluenceJson | undefined, known: boolean}} props */
function Row({ fit, widest, influence, known }) {
	const { text, grade, title } = influenceOf(influence);
	const name = fit.marking;
	return html`
		<tr
			data-marking=${name} data-lit=${hovered.value === name} data-chosen=${choice.value?.marking === name}
			onPointerEnter=${() => { hovered.value = name; }} onPointerLeave=${() => { hovered.value = null; }}
		>
			<td data-grade=${fit.grade}><span aria-hidden="true">${GLYPHS[fit.grade]}</span><span class="hidden-text">${fit.grade}</span></td>
			<th scope="row"><button class="row-button" type="button" aria-pressed=${choice.value?.marking === name} onClick=${() => pickMarking(name)}><span title=${name}>${name}</span></button></th>
			<td>${fit.points.length}${fit.used ? '' : html`<abbr title="left out by the solver">*</abbr>`}</td>
			<td><${Bar} fit=${fit} widest=${widest} /></td>
			<td data-grade=${fit.grade} data-number="largest">${fit.points.length ? pixels(fit.largest) : ''}</td>
			${known ? html`<td data-grade=${grade} title=${title} data-number="influence">${text}</td>` : null}
		</tr>
	`;
}

/**
 * @param {{picture: ViewPicture, influences: InfluenceJson[] | null}} props
 */
export function LineTable({ picture, influences }) {
	const widest = WIDEST * diagonal(picture.view);
	const rows = picture.markings.filter(({ points, polyline }) => points.length > 0 || polyline.length > 1);
	const annotated = rows.filter(({ points }) => points.length > 0);
	const known = Boolean(influences?.some(({ jac }) => jac));
	const jac = picture.solved?.calibration.jac ?? null;
	return html`
		<section class="card strip-card" aria-label="Table of line errors">
			<h2>Lines · ${annotated.length}<span class="card__aside">JaC ${['0.5', '1', '2'].map((gamma) => fixed(jac?.[gamma], 2)).join(' · ')}</span></h2>
			<div class="editor__scroll" tabindex="0" role="group" aria-label="Table of line errors">
				<table class="numbers line-table" data-stale=${changed.value}>
					<thead>
						<tr>
							<th scope="col"><span class="hidden-text">state</span></th><th scope="col">marking</th>
							<th scope="col" title="Annotated points">n</th>
							<th scope="col" title="Largest distance of a point; ticks at 0.5 and 1 % of the image diagonal, a full bar is 2 %">worst</th>
							<th scope="col" title="Worst point, pixels">px</th>
							${known ? html`<th scope="col" title=${`Change of JaC 0.5 % when the camera is found without this line${changed.value ? '; for the saved lines' : ''}`}>ΔJaC</th>` : null}
						</tr>
					</thead>
					<tbody>
						${rows.map((fit) => html`
							<${Row} key=${fit.marking} fit=${fit} widest=${widest} known=${known}
								influence=${influences?.find(({ marking }) => marking === fit.marking)} />`)}
						${rows.length ? null : html`<tr><td></td><td colspan="4">No lines yet. Choose a marking in the diagram and draw it.</td></tr>`}
					</tbody>
				</table>
				<div class="view-lines__more"><${Undrawn} picture=${picture} /></div>
			</div>
		</section>
	`;
}
