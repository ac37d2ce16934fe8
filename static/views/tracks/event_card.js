// @ts-check
/** Events of a track: added, removed, and restored. */

import { html } from 'htm/preact';

import { eventAt, EVENTS } from '../../state/tracks.js';

/** @import {Correction, EventKind, TrackFrames} from '../../api/tracks.js' */

/** @param {{frames: TrackFrames, removed: Correction[], at: number, goTo: (frame: number) => void, correct: (kind: EventKind, added: boolean) => void, restore: (one: Correction) => void}} props */
export function EventCard({ frames, removed, at, goTo, correct, restore }) {
	const event = eventAt(frames.events, at);
	return html`
		<section class="card" aria-labelledby="events-title">
			<h2 id="events-title">Events <small>${frames.events.length}</small></h2>
			<p class="buttons">
				${EVENTS.map(({ kind, key }) => html`<button key=${kind} class="button button--small" type="button" data-needs="review" onClick=${() => correct(kind, true)}>Add ${kind} <kbd>${key}</kbd></button>`)}
				<button class="button button--small" type="button" data-needs="review" aria-disabled=${!event} title=${event ? '' : 'No event is near this frame'} onClick=${() => { if (event) correct(event.kind, false); }}>Remove${event ? ` ${event.kind}` : ''} <kbd>D</kbd></button>
			</p>
			<ol class="track__list" aria-label="List of events">
				${frames.events.map((one) => html`<li key=${`${one.frame} ${one.kind}`}><button class="track__event" type="button" aria-current=${one === event ? 'true' : undefined} onClick=${() => goTo(one.frame)}><span class="mono">${one.frame}</span> ${one.kind}${one.added ? ' (added)' : ''}</button></li>`)}
			</ol>
			${removed.length ? html`
				<ul class="track__list" aria-label="Removed events">
					${removed.map((one) => html`<li key=${`${one.frame} ${one.kind}`} class="track__removed"><button class="track__event" type="button" onClick=${() => goTo(one.frame)}>removed: ${one.kind} <span class="mono">${one.frame}</span></button><button class="button button--small" type="button" data-needs="review" onClick=${() => restore(one)}>Restore<span class="hidden-text"> the ${one.kind} of frame ${one.frame}</span></button></li>`)}
				</ul>` : null}
		</section>
	`;
}
