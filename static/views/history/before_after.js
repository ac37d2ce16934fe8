// @ts-check
/** What an entry has changed, in the picture: before and after, cropped around the change. */

import { html } from 'htm/preact';

import { getStep } from '../../api/history.js';
import { sentenceOf } from '../../api/problem.js';
import { ballsChanged, changedMarkings, changeWindow } from '../../geometry/change_window.js';
import { useResource } from '../../lib/resource.js';
import { Letter } from '../letter.js';

/** @import {ChangedView, PastView, StepJson} from '../../api/history.js' */
/** @import {BallJson, PointJson} from '../../api/types.js' */

/** @param {PointJson[]} points */
const path = (points) => points.map(({ x, y }) => `${x},${y}`).join(' ');

/** @param {{name: string, points: PointJson[], tone: string, size: number}} props `size`: of a point, image pixels */
function Line({ name, points, tone, size }) {
	return html`<g class="past__line" data-tone=${tone}><title>${name}</title>
		<polyline points=${path(points)} />
		${tone === 'still' ? null : points.map(({ x, y }) => html`<circle cx=${x} cy=${y} r=${size} />`)}
	</g>`;
}

/** @param {{ball: BallJson, tone: string, size: number}} props */
function Ball({ ball, tone, size }) {
	const { box, point } = ball;
	if (box) return html`<rect class="past__ball" data-tone=${tone} x=${box[0]} y=${box[1]} width=${box[2]} height=${box[3]} />`;
	return point ? html`<circle class="past__ball" data-tone=${tone} cx=${point[0]} cy=${point[1]} r=${3 * size} />` : null;
}

/** @param {{state: PastView, tone: string, size: number, markings: string[], balls: boolean, still?: boolean}} props `still`: what was not changed, too */
function Overlay({ state, tone, size, markings, balls, still = false }) {
	const names = Object.keys(state.lines).filter((name) => still || markings.includes(name));
	return html`
		${names.map((name) => html`<${Line} key=${name} name=${name} points=${state.lines[name]} tone=${markings.includes(name) ? tone : 'still'} size=${size} />`)}
		${state.balls.filter(() => still || balls).map((ball, i) => html`<${Ball} key=${i} ball=${ball} tone=${balls ? tone : 'still'} size=${size} />`)}`;
}

/** @param {{view: ChangedView, state: PastView | null, other: PastView | null, tone: 'before' | 'after', title: string}} props */
function Side({ view, state, other, tone, title }) {
	const { x, y, width, height } = changeWindow(view);
	const first = view.before === null;
	const markings = first ? [] : changedMarkings(view.before, view.after);
	const balls = !first && ballsChanged(view.before, view.after);
	const size = width / 180;
	const words = `View ${view.letter} ${title.toLowerCase()}${markings.length ? `: ${markings.join(', ')}` : ''}${balls ? `${markings.length ? ',' : ':'} ball` : ''}`;
	return html`
		<figure class="past__side">
			<svg class="past__picture" viewBox=${`${x} ${y} ${width} ${height}`} role="img" aria-label=${words}>
				${view.image ? html`<image href=${view.image} width=${view.width} height=${view.height} preserveAspectRatio="none" />` : null}
				${other ? html`<g class="past__other"><${Overlay} state=${other} tone=${tone === 'before' ? 'after' : 'before'} size=${size} markings=${markings} balls=${balls} /></g>` : null}
				${state ? html`<${Overlay} state=${state} tone=${tone} size=${size} markings=${markings} balls=${balls} still=${true} />` : null}
			</svg>
			<figcaption>${title}${state && !state.included ? ' · not used' : ''}${state ? '' : ' · did not exist'}</figcaption>
		</figure>
	`;
}

/** @param {{step: StepJson}} props */
function Pitches({ step }) {
	const { pitch_before: old, pitch_after: now } = step;
	if (!old || (old.length === now.length && old.width === now.width)) return null;
	return html`<p>Pitch: ${old.length} × ${old.width} m, then ${now.length} × ${now.width} m.</p>`;
}

/** @param {{group: number, entry: number}} props */
export function BeforeAfter({ group, entry }) {
	const found = useResource((signal) => getStep(group, entry, signal), [group, entry]);
	if (found.error) return html`<p class="form__error" role="alert">${sentenceOf(found.error)}</p>`;
	const step = found.value;
	if (!step) return html`<p class="past__none" role="status">Reading…</p>`;
	return html`
		<div class="past__step">
			<${Pitches} step=${step} />
			${step.views.length ? step.views.map((view) => html`
				<div class="past__view" key=${view.key}>
					<p><${Letter} letter=${view.letter} /> <span class="past__key">${view.key}</span></p>
					<div class="past__pair">
						${view.before ? html`<${Side} view=${view} state=${view.before} other=${view.after} tone="before" title="Before" />` : null}
						<${Side} view=${view} state=${view.after} other=${view.before} tone="after" title=${view.before ? 'After' : 'As imported'} />
					</div>
				</div>`) : html`<p class="past__none">This change affected no lines or balls.</p>`}
		</div>
	`;
}
