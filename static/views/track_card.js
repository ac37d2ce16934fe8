// @ts-check
/** The track that the group on screen is in: the way to its page, and what an edit makes of the frames around it. */

import { html } from 'htm/preact';
import { useEffect } from 'preact/hooks';

import { fixed, pixelText } from '../lib/format.js';
import { useKeys } from '../lib/hooks.js';
import { address, navigate } from '../lib/router.js';
import { groupTrack, startGroupTrack, trackAround } from '../state/group_track.js';
import { explain } from '../state/notice.js';
import { STATES } from '../state/tracks.js';
import { verdictText } from './tracks/tracks_page.js';

/** @import {TrackAround} from '../api/tracks.js' */
/** @import {Binding} from '../lib/keys.js' */

/** The page of the track at the frame on screen; "" where there is none. */
function trackAddress() {
	const at = groupTrack.value;
	return at ? address(`/tracks/${at.track.id}`, { frame: String(at.frame) }) : '';
}

/** @type {Binding[]} */
const KEYS = [
	{ keys: ['Shift+v'], label: 'Track of the ball, at this frame', group: 'View', run: () => {
		if (groupTrack.value) navigate(trackAddress());
		else explain('This group is in no track.');
	} },
];

/** What comes of the frames around, as their groups are now. @param {{around: TrackAround, frame: number}} props */
function Now({ around, frame }) {
	const place = around.frame.indexOf(frame);
	if (around.reason || place < 0) return html`<p class="note">${around.reason ?? 'Nothing is known around this frame.'}</p>`;
	const [x, y, z, sigma, left] = [around.x[place], around.y[place], around.z[place], around.sigma[place], around.left_out_px[place]];
	const against = around.contradicted.filter((one) => one.frame === frame);
	return html`
		<dl class="facts" data-around=${frame}>
			<dt>Ball</dt><dd>${x === null || y === null || z === null ? 'not known' : `x ${fixed(x, 2)}, y ${fixed(y, 2)}, height\u00a0${fixed(-z, 2)}\u00a0m`}</dd>
			<dt>Sigma</dt><dd>${sigma === null ? '–' : `${fixed(sigma, 2)} m`}</dd>
			<dt>Source</dt><dd>${STATES[around.state[place]]}</dd>
			<dt>Left-out error</dt><dd>${left === null ? '–' : pixelText(left)}</dd>
		</dl>
		<p class="note">${against.length ? `${against.map(({ view }) => view).join(', ')} ${against.length > 1 ? 'contradict' : 'contradicts'} the track.` : 'No ball in this frame contradicts the track.'} Frames ${around.frame[0]} to ${around.frame.at(-1)} with the groups as they are now; the saved track is out of date until it is made again.</p>
	`;
}

export function TrackCard() {
	useEffect(() => startGroupTrack(), []);
	useKeys(KEYS);
	const [at, around] = [groupTrack.value, trackAround.value];
	if (!at) return null;
	return html`
		<section class="card track-card" aria-label="Track of the ball" data-stale=${at.track.stale}>
			<h2>Track of the ball<span class="card__aside">${verdictText(at.track)}</span></h2>
			<p><a class="link" href=${trackAddress()}>Frame ${at.frame} of ${at.track.key} <kbd>⇧V</kbd></a></p>
			${around ? html`<${Now} around=${around} frame=${at.frame} />` : null}
		</section>
	`;
}
