// @ts-check
/** What two annotations say differently, and the numbers of the view that is shown. */

import { html } from 'htm/preact';

import { capital, fixed, metres, pixelText, words } from '../../lib/format.js';
import { numbers, pair, pointed, pointOut } from '../../state/compare.js';
import { Letter } from '../letter.js';

/** @import {ViewDistanceJson} from '../../api/agreement.js' */
/** @import {GroupDocument} from '../../api/types.js' */

/** A sentence about annotations a and b, with the names that people see. @param {string} sentence @param {[string, string]} names */
function withNames(sentence, [a, b]) {
	return capital(sentence.replace(/\bannotation ([ab])\b/g, (_, which) => `annotation ${which === 'a' ? a : b}`));
}

/** @param {{group: GroupDocument, names: [string, string]}} props */
export function DifferenceList({ group, names }) {
	const found = pair.value?.disagreements ?? [];
	const letters = new Map(group.views.map(({ key, letter }) => [key, letter]));
	return html`
		<section class="card compare__card" aria-labelledby="compare-differences">
			<h2 id="compare-differences">Differences beyond the limits<span class="card__aside">${found.length || 'none'}</span></h2>
			<div class="compare__scroll" tabindex="0" role="group" aria-label="Differences, the worst first">
				${found.length === 0 ? html`<p>All differences are within the limits.</p>` : html`
					<ol class="compare__list">
						${found.map((one, i) => html`
							<li key=${`${one.kind} ${one.view} ${one.marking} ${i}`}>
								<button class="compare__difference" type="button" aria-pressed=${pointed.value === one} onClick=${() => pointOut(one)}>
									${one.view === null ? html`<span class="compare__whole">all</span>` : html`<${Letter} letter=${letters.get(one.view) ?? ''} />`}
									<span>${withNames(one.sentence, names)}</span>
									${one.limit === null ? null : html`<small>limit ${one.limit}</small>`}
								</button>
							</li>`)}
					</ol>`}
			</div>
		</section>
	`;
}

/** @param {{label: string, value: string, grade?: string}} props */
function Row({ label, value, grade }) {
	return html`<tr><th scope="row">${label}</th><td data-numeric="true" data-grade=${grade}>${value}</td></tr>`;
}

/** @param {number | null} value @param {number} limit @param {boolean} [atLeast] */
function gradeOf(value, limit, atLeast = false) {
	if (value === null) return undefined;
	return (atLeast ? value < limit : value > limit) ? 'warn' : 'ok';
}

/** @param {{names: [string, string], limits: import('../../api/agreement.js').LimitsJson, letter: string}} props */
export function NumberCard({ names, limits, letter }) {
	const view = numbers.value;
	const ball = pair.value?.distance.ball ?? null;
	if (!view) return null;
	const explained = ball?.explained === null || !ball ? '' : ball.explained ? ' · within the σ of both' : ' · beyond the σ of both';
	return html`
		<section class="card compare__card" aria-labelledby="compare-numbers">
			<h2 id="compare-numbers">In numbers<span class="card__aside">view <${Letter} letter=${letter} /></span></h2>
			<div class="compare__scroll" tabindex="0" role="group" aria-label="How far the two annotations are apart">
				<table class="numbers compare__numbers"><tbody>
					<${BallRows} view=${view} names=${names} limits=${limits} />
					<${Row} label=${`JaC, camera of ${names[0]} on lines of ${names[1]}`} value=${fixed(view.jac[0], 2)} grade=${gradeOf(view.jac[0], limits.jac, true)} />
					<${Row} label=${`JaC, camera of ${names[1]} on lines of ${names[0]}`} value=${fixed(view.jac[1], 2)} grade=${gradeOf(view.jac[1], limits.jac, true)} />
					<${Row} label="cameras apart" value=${metres(view.position_m)} />
					<${Row} label=${`3D balls apart${explained}`} value=${metres(ball?.distance_m ?? null)} grade=${gradeOf(ball?.distance_m ?? null, limits.ball_m)} />
					${ball?.sigmas_m.some((one) => one !== null) ? html`<${Row} label="σ of both 3D balls" value=${ball.sigmas_m.map((one) => metres(one)).join(' and ')} />` : null}
					${view.lines.map((line) => html`<${Row}
						key=${line.marking} label=${line.marking}
						value=${line.only ? `only annotation ${names[line.only === 'a' ? 0 : 1]}` : `${pixelText(line.mean_px)}, at most ${pixelText(line.largest_px)}`}
						grade=${line.only ? 'warn' : gradeOf(line.largest_px, limits.line_px)} />`)}
				</tbody></table>
			</div>
		</section>
	`;
}

/** @param {{view: ViewDistanceJson, names: [string, string], limits: import('../../api/agreement.js').LimitsJson}} props */
function BallRows({ view: { ball }, names, limits }) {
	const same = ball.a === ball.b;
	const said = same ? words(ball.a) : `${names[0]} ${words(ball.a)}, ${names[1]} ${words(ball.b)}`;
	return html`
		<${Row} label="ball" value=${said} grade=${same ? 'ok' : 'warn'} />
		<${Row} label="ball centres apart" value=${pixelText(ball.center_px)} grade=${gradeOf(ball.center_px, limits.ball_px)} />
		<${Row} label="ball diameters" value=${`${ball.diameter_px !== null && ball.diameter_px > 0 ? '+' : ''}${pixelText(ball.diameter_px)}`} grade=${gradeOf(ball.diameter_px === null ? null : Math.abs(ball.diameter_px), limits.diameter_px)} />
	`;
}
