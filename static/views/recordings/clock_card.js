// @ts-check
/** What the clock of the match shows in a frame; the time of all others follows from that. */

import { html } from 'htm/preact';

import { getRecording, patchRecording } from '../../api/recordings.js';
import { useAttempt } from '../../lib/attempt.js';
import { withForm } from '../../lib/field.js';
import { clockSeconds, clockText, HALVES } from '../../state/shots.js';
import { goTo, wanted } from '../../state/playback.js';
import { FormError } from '../form_error.js';

/** @import {MatchClock, RecordingJson} from '../../api/recordings.js' */

/** @param {{one: RecordingJson, reload: () => void}} props */
export function ClockCard({ one, reload }) {
	const { error, attempt } = useAttempt();
	/** Change the readings as they are by now, also those of other people. @param {(clocks: MatchClock[]) => MatchClock[]} change */
	const send = (change) => attempt(getRecording(one.id).then(({ clocks }) => patchRecording(one.id, { clocks: change(clocks) })), reload);
	const set = withForm((said, form) => {
		const clock = { frame: wanted.value, half: Number(said.get('half')), seconds: clockSeconds(String(said.get('time'))) ?? 0 };
		send((clocks) => [...clocks.filter(({ frame }) => frame !== clock.frame), clock]).then((done) => { if (done) form.reset(); });
	});
	return html`
		<section class="card" aria-label="Time of the match">
			<h2>Time of the match</h2>
			<form class="buttons" onSubmit=${set}>
				<label class="hidden-text" for="clock-half">Half</label>
				<select class="field" id="clock-half" name="half">${HALVES.map((name, index) => html`<option key=${name} value=${String(index + 1)}>${name}</option>`)}</select>
				<label class="hidden-text" for="clock-time">What the clock shows in this frame</label>
				<input class="field film__step" id="clock-time" name="time" placeholder="12:40" pattern="[0-9]{1,3}:[0-5][0-9]" title="Minutes and seconds, such as 12:40" required autocomplete="off" />
				<button class="button button--small" type="submit" data-needs="annotate" data-of=${one.dataset}>Set for this frame</button>
			</form>
			${error ? html`<${FormError} error=${error} />` : null}
			${one.clocks.length ? html`
				<ul class="linking__list">
					${one.clocks.map((clock) => html`
						<li key=${clock.frame}>
							<button class="link-button" type="button" onClick=${() => goTo(clock.frame)}>frame ${clock.frame}</button> ${clockText(clock.half, clock.seconds)}
							<button class="button button--small" type="button" data-needs="annotate" data-of=${one.dataset} onClick=${() => send((clocks) => clocks.filter(({ frame }) => frame !== clock.frame))}>Remove<span class="hidden-text"> the clock of frame ${clock.frame}</span></button>
						</li>`)}
				</ul>` : html`<p class="empty-note">Go to a frame in which the match clock changes, and enter the time that it shows.</p>`}
		</section>
	`;
}
