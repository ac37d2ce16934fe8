// @ts-check
/** The links of the shot that is shown: of a replay, to live shots; of a live shot, its replays. */

import { html } from 'htm/preact';
import { useState } from 'preact/hooks';

import { getLiveSuggestions, postLink } from '../../api/recordings.js';
import { useAttempt } from '../../lib/attempt.js';
import { plural } from '../../lib/format.js';
import { useResource } from '../../lib/resource.js';
import { navigate } from '../../lib/router.js';
import { clockOf, kindOf, timecode } from '../../state/shots.js';
import { FormError } from '../form_error.js';

/** @import {LinkedShot, LinkJson, RecordingJson, Shot} from '../../api/recordings.js' */

/** @param {{recording: number, link: number}} where */
const linkAddress = ({ recording, link }) => `/recordings/${recording}/links/${link}`;

/** Whether a link's side is a shot, or what it is now. @param {LinkedShot} side @param {number} recording @param {Shot} shot */
const covers = (side, recording, shot) => side.recording === recording && side.first <= shot.last && shot.first <= side.last;

/** A link as one line. @param {{link: LinkJson, side: LinkedShot, one: RecordingJson}} props */
function Line({ link, side, one }) {
	const name = side.recording === one.id ? '' : `${side.name}, `;
	return html`<li><a class="link" href=${linkAddress({ recording: link.live.recording, link: link.id })}>${name}frames ${side.first} to ${side.last}</a> <small>${plural(link.instants.length, 'instant')}</small></li>`;
}

/** @param {{one: RecordingJson, shots: Shot[], shot: Shot}} props */
function Suggestions({ one, shots, shot }) {
	const found = useResource((signal) => getLiveSuggestions(one.id, shot.first, signal), [one.id, shot.first, shots]);
	const { error, attempt } = useAttempt();
	const [other, setOther] = useState('');
	/** @param {{recording: number, first: number, last: number}} live */
	function link({ recording, first, last }) {
		const body = { live: { first, last }, replay: { recording: one.id, first: shot.first, last: shot.last } };
		attempt(postLink(recording, body), (made) => navigate(linkAddress({ recording, link: made.id })));
	}
	const items = (found.value?.items ?? []).filter((item) => item.link === null);
	const others = shots.map((live, index) => ({ live, index })).filter(({ live }) => live !== shot);
	const seconds = clockOf(shots, one.fps ?? 25);
	const chosen = others.find(({ index }) => String(index) === other)?.live;
	return html`
		<h3>Link to the live shot</h3>
		${found.error ? html`<${FormError} error=${found.error} />` : null}
		${error ? html`<${FormError} error=${error} />` : null}
		${found.value && !found.value.items.length ? html`<p class="empty-note">No shot of the main camera comes before this replay. Choose the live shot from the list.</p>` : null}
		<ul class="linking__choices">
			${items.map((item) => html`
				<li key=${`${item.recording}-${item.first}`}>
					<button class="button button--small" type="button" data-needs="annotate" data-of=${one.dataset} onClick=${() => link(item)}>Link<span class="hidden-text"> to ${item.name}</span> ${timecode(item.recording === one.id ? seconds(item.first) : item.first / (one.fps ?? 25), one.fps ?? 25)}</button>
					<small>${item.why}</small>
				</li>`)}
		</ul>
		<div class="linking__other">
			<label class="hidden-text" for="link-other">Another live shot</label>
			<select class="field" id="link-other" value=${other} onChange=${(/** @type {Event} */ event) => setOther(/** @type {HTMLSelectElement} */ (event.target).value)}>
				<option value="">Another shot…</option>
				${others.map(({ live, index }) => html`<option key=${index} value=${String(index)}>Shot ${index + 1}: ${kindOf(live.kind).label}, ${timecode(seconds(live.first), one.fps ?? 25)}</option>`)}
			</select>
			<button class="button button--small" type="button" data-needs="annotate" data-of=${one.dataset} aria-disabled=${!chosen} title=${chosen ? '' : 'Choose a shot first'} onClick=${() => { if (chosen) link({ recording: one.id, first: chosen.first, last: chosen.last }); }}>Link</button>
		</div>
	`;
}

/** @param {{one: RecordingJson, shots: Shot[], shot: Shot | undefined, links: LinkJson[]}} props */
export function LinkCard({ one, shots, shot, links }) {
	if (!shot) return null;
	const live = links.filter((link) => covers(link.replay, one.id, shot));
	const replays = links.filter((link) => covers(link.live, one.id, shot));
	const isReplay = shot.kind === 'replay';
	if (!isReplay && !live.length && !replays.length) return null;
	return html`
		<section class="card" aria-label="Links">
			<h2>${isReplay ? 'Replay of' : 'Replays'}<span class="card__aside">${plural(live.length + replays.length, 'link')}</span></h2>
			${live.length ? html`<ul class="linking__list">${live.map((link) => html`<${Line} key=${link.id} link=${link} side=${link.live} one=${one} />`)}</ul>` : null}
			${replays.length ? html`<ul class="linking__list">${replays.map((link) => html`<${Line} key=${link.id} link=${link} side=${link.replay} one=${one} />`)}</ul>` : null}
			${isReplay ? html`<${Suggestions} key=${shot.first} one=${one} shots=${shots} shot=${shot} />` : null}
		</section>
	`;
}
