// @ts-check
/** The way from a followed ball that contradicts a track, in a frame without a group, to the frame of its recording. */

import { html } from 'htm/preact';

import { getLink, getLinkedFrames, getRecordings } from '../../api/recordings.js';
import { useResource } from '../../lib/resource.js';
import { replayFrameAt } from '../../state/links.js';

/** @import {TrackJson} from '../../api/tracks.js' */

/** Recording and frame of a view at a frame of a track; null: unknown. @param {TrackJson} track @param {string} view @param {number} frame @param {AbortSignal} signal */
async function placeOf({ dataset, match }, view, frame, signal) {
	const { items } = await getRecordings(signal);
	const live = items.find((one) => one.dataset === dataset && one.name === match);
	if (!live) return null;
	if (view === match) return { recording: live.id, name: match, frame };
	const link = Number(/ link (\d+)$/.exec(view)?.[1] ?? NaN);
	if (Number.isNaN(link)) return null;
	const [{ replay }, frames] = await Promise.all([getLink(live.id, link, signal), getLinkedFrames(live.id, link, signal)]);
	const there = replayFrameAt(frames, frame);
	return there === null ? null : { recording: replay.recording, name: replay.name, frame: there };
}

/** @param {{track: TrackJson, view: string, frame: number}} props */
export function ClickAgain({ track, view, frame }) {
	const place = useResource((signal) => placeOf(track, view, frame, signal), [track.id, view, frame]).value;
	return place && html`<p><a class="link" href=${`/recordings/${place.recording}?frame=${place.frame}`}>Click the ball again in frame ${place.frame} of ${place.name}</a></p>`;
}
