// @ts-check
/** Beside live shot and replay: what is known of the times, and the instants that say it. */

import { html } from 'htm/preact';

import { plural } from '../../lib/format.js';
import { withForm } from '../../lib/field.js';
import { mapText } from '../../state/links.js';

/** @import {ComponentChildren} from 'preact' */
/** @import {InstantPair, LinkedFrames, LinkJson} from '../../api/recordings.js' */

/** @param {{link: LinkJson, frames: LinkedFrames | null, fps: number, dataset: string, assume: (speed: number) => void, children?: ComponentChildren}} props */
export function TimesCard({ link, frames, fps, dataset, assume, children }) {
	const { map } = link;
	const [repeats, blends] = [frames?.repeated.length ?? 0, frames?.blended.length ?? 0];
	const slow = withForm((said) => assume(1 / Number(said.get('slow'))));
	return html`
		<section class="card" aria-label="Times">
			<h2>Times</h2>
			${children}
			<div role="status">${mapText(map, fps).map((sentence) => html`<p key=${sentence}>${sentence}</p>`)}</div>
			${map.outcome === 'offset' ? html`
				<form class="buttons" onSubmit=${slow}>
					<label for="link-slow">Assume that the replay is</label>
					<input class="field linking__slow" id="link-slow" name="slow" type="number" min="0.25" max="50" step="any" required defaultValue=${(1 / (map.speed ?? 1)).toFixed(2)} />
					<span>times slower</span>
					<button class="button button--small" type="submit" data-needs="annotate" data-of=${dataset}>Assume</button>
				</form>` : null}
			${repeats || blends ? html`<p class="empty-note">${[repeats ? `${plural(repeats, 'frame')} of the replay ${repeats === 1 ? 'repeats' : 'repeat'} the one before` : '', blends ? `${plural(blends, 'frame')} ${blends === 1 ? 'is a mix' : 'are mixes'} of two` : ''].filter(Boolean).join('; ')}. Groups use other frames if they can.</p>` : null}
		</section>
	`;
}

/** @param {{link: LinkJson, dataset: string, show: (one: InstantPair) => void, remove: (replay: number) => void, children?: ComponentChildren}} props */
export function InstantsList({ link, dataset, show, remove, children }) {
	const { instants } = link;
	return html`
		<section class="card" aria-label="Instants">
			<h2>Instants<span class="card__aside">${plural(instants.length, 'instant')}</span></h2>
			${instants.length ? html`
				<table class="table linking__instants">
					<thead><tr><th>live</th><th>replay</th><th data-numeric="true">off, frames</th><td></td></tr></thead>
					<tbody>
						${instants.map((one) => html`
							<tr key=${one.replay}>
								<th scope="row"><button class="link-button" type="button" title="Show both frames" onClick=${() => show(one)}>${one.live}</button></th>
								<td>${one.replay}</td>
								<td data-numeric="true">${one.residual === null ? '' : (Math.abs(one.residual) < 0.05 ? 0 : one.residual).toFixed(1)}</td>
								<td><button class="button button--small" type="button" data-needs="annotate" data-of=${dataset} onClick=${() => remove(one.replay)}>Remove<span class="hidden-text"> the instant at live frame ${one.live}</span></button></td>
							</tr>`)}
					</tbody>
				</table>` : html`<p class="empty-note">None yet.</p>`}
			${children}
		</section>
	`;
}
