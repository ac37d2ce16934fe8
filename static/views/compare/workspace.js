// @ts-check
/** Annotations of the same frames beside each other, and what they differ in. */

import { html } from 'htm/preact';
import { useMemo } from 'preact/hooks';

import { useKeys } from '../../lib/hooks.js';
import { picturesOf } from '../../overlays/scene.js';
import {
	comparison, differencesOf, orderedViews, others, pair, shownView, showView, stepDifference, stepView, zoomToBall,
} from '../../state/compare.js';
import { announce } from '../../state/notice.js';
import { fitAll } from '../../state/viewports.js';
import { boxes, cycleGain, gain, overlaysHidden, projections } from '../../state/workspace.js';
import { Letter } from '../letter.js';
import { AnnotationPanel } from './annotation_panel.js';
import { DifferenceList, NumberCard } from './differences.js';

/** @import {Binding} from '../../lib/keys.js' */

function zoomIn() {
	const panel = document.querySelector('.compare__panel .image-panel__stage');
	if (panel) zoomToBall({ width: panel.clientWidth, height: panel.clientHeight });
}

/** @type {Binding[]} */
const KEYS = [
	{ keys: ['ArrowRight'], label: 'Next view', group: 'Compare', repeats: true, run: () => stepView(1) },
	{ keys: ['ArrowLeft'], label: 'Previous view', group: 'Compare', repeats: true, run: () => stepView(-1) },
	{ keys: ['n'], label: 'Next difference', group: 'Compare', repeats: true, run: () => stepDifference(1) },
	{ keys: ['Shift+n'], label: 'Previous difference', group: 'Compare', repeats: true, run: () => stepDifference(-1) },
	{ keys: ['o'], label: 'Show or hide the other person’s annotation (dashed)', group: 'View', run: () => { others.value = !others.value; announce(`The other person’s annotation is ${others.value ? 'shown' : 'hidden'}.`); } },
	{ keys: ['h'], label: 'Hide or show all overlays', group: 'View', run: () => { overlaysHidden.value = !overlaysHidden.value; } },
	{ keys: ['p'], label: 'Projected lines', group: 'View', run: () => { projections.value = !projections.value; } },
	{ keys: ['b'], label: 'Ball boxes', group: 'View', run: () => { boxes.value = !boxes.value; } },
	{ keys: ['w'], label: 'Error lines × 1, 5, 20', group: 'View', run: () => { cycleGain(); announce(`Error lines are drawn ${gain.value} times as long.`); } },
	{ keys: ['z'], label: 'Zoom to the ball in all pictures; press again to show the whole images', group: 'View', run: zoomIn },
	{ keys: ['0'], label: 'Leave the zoom', group: 'View', run: fitAll },
];

/** Views, the worst first. */
function ViewTabs() {
	return html`
		<nav class="compare__views" aria-label="Views, the worst first">
			${orderedViews.value.map(({ key, letter, label }) => {
				const count = differencesOf(key).length;
				return html`<button
					key=${key} class="editor__tab" type="button" aria-current=${key === shownView.value ? 'true' : undefined}
					onClick=${() => showView(key)}
				><${Letter} letter=${letter} /><span class="editor__tab-name">${label}</span>${count ? html`<span class="compare__count" data-grade="warn">${count}<span class="hidden-text"> ${count === 1 ? 'difference' : 'differences'}</span></span>` : null}</button>`;
			})}
		</nav>
	`;
}

/** @param {{label: string, on: boolean, letter: string, flip: () => void}} props */
function Toggle({ label, on, letter, flip }) {
	return html`<button class="button" type="button" aria-pressed=${on} onClick=${flip}>${label} <kbd>${letter}</kbd></button>`;
}

/** What is shown in the pictures. */
function Toggles() {
	return html`
		<div class="buttons compare__toggles" role="group" aria-label="Overlays">
			<${Toggle} label="The other’s" letter="O" on=${others.value} flip=${() => { others.value = !others.value; }} />
			<${Toggle} label="Projected lines" letter="P" on=${projections.value} flip=${() => { projections.value = !projections.value; }} />
			<${Toggle} label="Boxes" letter="B" on=${boxes.value} flip=${() => { boxes.value = !boxes.value; }} />
			<${Toggle} label="Ball" letter="Z" on=${false} flip=${zoomIn} />
		</div>
	`;
}

/**
 * @param {{names: string[], images: Map<string, string | null>, chosen: number | null, choose: ((place: number) => void) | null, children?: import('preact').ComponentChildren}} props
 *   names: of who annotated, in order; images: address of the frame by view; choose: takes one; children: below the numbers
 */
export function CompareWorkspace({ names, images, chosen, choose, children }) {
	useKeys(KEYS);
	const found = comparison.value;
	const pictures = useMemo(() => (found?.groups ?? []).map((group) => picturesOf(group, group.solution, group)), [found]);
	const two = pair.value;
	if (!found || !two) return null;
	const key = shownView.value;
	const letter = found.groups[0].views.find((view) => view.key === key)?.letter ?? '';
	const sides = /** @type {[string, string]} */ ([String(two.a + 1), String(two.b + 1)]);
	return html`
		<main class="compare__main" data-annotations=${found.groups.length}>
			<h1 class="hidden-text">Annotations of ${found.groups[0].label} beside each other</h1>
			<div class="compare__bar"><${ViewTabs} /><${Toggles} /></div>
			<div class="compare__pictures">
				${pictures.map((all, place) => {
					const picture = all.find(({ view }) => view.key === key);
					if (!picture) return null;
					const beside = place === two.a ? two.b : two.a;
					return html`<${AnnotationPanel}
						key=${place} picture=${picture} number=${place + 1} name=${names[place]} image=${images.get(key) ?? null}
						other=${found.groups[beside].views.find((view) => view.key === key) ?? null}
						chosen=${chosen === place} choose=${choose ? () => choose(place) : null} />`;
				})}
			</div>
			<div class="compare__below">
				<${DifferenceList} group=${found.groups[0]} names=${sides} />
				<${NumberCard} names=${sides} limits=${found.limits} letter=${letter} />
				${children}
			</div>
		</main>
	`;
}
