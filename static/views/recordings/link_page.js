// @ts-check
/** A replay beside its live shot: each is scrubbed by itself, one key links the frames on screen, and then both play together. */

import { html } from 'htm/preact';
import { useSignalEffect } from '@preact/signals';
import { useEffect, useLayoutEffect, useMemo, useRef, useState } from 'preact/hooks';

import { deleteLink, getLink, getLinkedFrames, getRecording, getShots, putInstants } from '../../api/recordings.js';
import { ApiError } from '../../api/problem.js';
import { useAttempt } from '../../lib/attempt.js';
import { plural } from '../../lib/format.js';
import { useKeys, useSize } from '../../lib/hooks.js';
import { useResource } from '../../lib/resource.js';
import { address, navigate, page, param, place } from '../../lib/router.js';
import { useDataset } from '../../state/datasets.js';
import { instantBeside, markOf, replayFrameAt, whyApart, withInstant } from '../../state/links.js';
import { announce, complain, explain } from '../../state/notice.js';
import { makePlayer } from '../../state/playback.js';
import { clockOf, matchTime, timecode } from '../../state/shots.js';
import { ConfirmButton } from '../confirm_button.js';
import { FormError } from '../form_error.js';
import { Loading, PageFrame, Trouble } from '../page_frame.js';
import { BallCard } from './link_ball.js';
import { InstantsList, TimesCard } from './link_rail.js';
import { keysOfLink } from './link_keys.js';

/** @import {InstantPair, LinkedFrames, LinkJson, LinkedShot, RecordingJson} from '../../api/recordings.js' */
/** @import {Player} from '../../state/playback.js' */

/** @typedef {'live' | 'replay'} Side */
/** @typedef {{instants: InstantPair[], assumed_speed: number | null}} Said */

/** So few frames before the end nothing is left to play. */
const END = 5;
/** How long frames are at hand before the address says so, milliseconds. */
const SETTLED = 300;
const NAMES = { live: 'Live', replay: 'Replay' };

/** The link, and what changes it: each change upon the last answer; the last one is taken back. @param {LinkJson} first */
function useLink(first) {
	const [link, setLink] = useState(first);
	const latest = useRef(first);
	const before = useRef(/** @type {Said[]} */ ([]));
	const sending = useRef(Promise.resolve());
	const [recording, id] = [first.live.recording, first.id];
	/** @param {LinkJson} next */
	function keep(next) {
		latest.current = next;
		setLink(next);
	}
	/** @param {(present: LinkJson) => Said | null} make null: nothing can be done @param {string} told @param {boolean} [remember] */
	function change(make, told, remember = true) {
		sending.current = sending.current.then(async () => {
			const present = latest.current;
			const next = make(present);
			if (!next) return;
			try {
				keep(await putInstants(recording, id, next, present.etag));
				if (remember) before.current.push(present);
				announce(told);
			} catch (problem) {
				if (!(problem instanceof ApiError)) throw problem;
				if (problem.status === 412) await meet();
				else complain(problem.message);
			}
		});
	}
	const reload = async () => keep(await getLink(recording, id));
	/** It was changed elsewhere first. */
	async function meet() {
		before.current = [];
		try {
			await reload();
			complain('This link changed in another window or by another person; the page shows the new state.');
		} catch (problem) {
			if (!(problem instanceof ApiError)) throw problem;
			complain(`This link changed in another window or by another person. Load the page again to see the new state: ${problem.message}`);
		}
	}
	return { link, change, reload, undo: () => change(() => { const last = before.current.pop(); if (!last) explain('There is nothing to undo.'); return last ?? null; }, 'Undone.', false) };
}

/** @param {{side: Side, shot: LinkedShot, player: Player, one: RecordingJson, focused: boolean, focus: () => void, mark: string}} props */
function Stage({ side, shot, player, one, focused, focus, mark }) {
	const [ref, size] = useSize();
	useLayoutEffect(() => { if (size.width) player.showAt(size.width * Math.min(devicePixelRatio, 2)); }, [size.width]);
	const { frame, address } = player.seen.value;
	const [wanted, fps] = [player.wanted.value, one.fps ?? 25];
	const shots = useResource((signal) => getShots(one.id, signal), [one.id]).value?.items ?? [];
	const seconds = clockOf(shots, fps);
	const name = NAMES[side];
	return html`
		<section class="linking__side" aria-label=${name} data-focused=${focused} data-frame=${frame} onPointerDown=${focus} onFocusIn=${focus}>
			<h2>${name} <kbd>${side === 'live' ? '1' : '2'}</kbd><span class="card__aside">${shot.name}, frames ${shot.first} to ${shot.last}</span></h2>
			<div class="film__picture" ref=${ref} style=${{ aspectRatio: `${one.width ?? 16} / ${one.height ?? 9}` }}>${address ? html`<img src=${address} alt=${`Frame ${frame} of ${shot.name}`} />` : null}</div>
			<input
				type="range" class="linking__slider" aria-label=${`${name} frame`} min=${shot.first} max=${shot.last} step="1" value=${wanted}
				aria-valuetext=${`frame ${wanted}, ${timecode(seconds(wanted), fps)}`}
				onInput=${(/** @type {Event} */ event) => { player.stand(); player.goTo(Number(/** @type {HTMLInputElement} */ (event.target).value)); }}
			/>
			<p class="film__time">
				<strong class="mono">${timecode(seconds(wanted), fps)}</strong>
				${one.clocks.length ? html`<span>${matchTime(one.clocks, seconds, wanted)}</span>` : null}
				<span>frame ${wanted}</span>
				${player.speed.value ? html`<span>${player.speed.value} ×</span>` : null}
				${mark ? html`<span class="linking__mark">${mark}</span>` : null}
				${player.playTrouble.value ? html`<span class="form__error" role="alert">${player.playTrouble.value}</span>` : null}
			</p>
		</section>
	`;
}

/** Write both frames into the address while nothing plays, so that a reload and Back find them. @param {number} link @param {{live: Player, replay: Player}} players */
function useFramesInAddress(link, players) {
	const [live, replay] = [players.live.wanted.value, players.replay.wanted.value];
	const plays = players.live.speed.value !== 0 || players.replay.speed.value !== 0;
	useLayoutEffect(() => {
		if (plays) return undefined;
		const timer = setTimeout(() => {
			const shown = page.peek();
			// The next page may be asked for and not yet drawn.
			if (shown.page !== 'link' || shown.link !== link || (param('live') === String(live) && param('replay') === String(replay))) return;
			navigate(address(place.peek().path, { live: String(live), replay: String(replay) }), { replace: true });
		}, SETTLED);
		return () => clearTimeout(timer);
	}, [live, replay, plays]);
}

/** @param {{first: LinkJson, recordings: {live: RecordingJson, replay: RecordingJson}}} props */
function Both({ first, recordings }) {
	const { link, change, reload, undo } = useLink(first);
	const players = useMemo(() => ({ live: makePlayer(), replay: makePlayer() }), [first.id]);
	const [side, setSide] = useState(/** @type {Side} */ ('live'));
	const [together, setTogether] = useState(false);
	const { error, attempt } = useAttempt();
	const frames = useResource((signal) => getLinkedFrames(first.live.recording, first.id, signal), [first.id, link.etag]);
	const mapped = useRef(/** @type {LinkedFrames | null} */ (null));
	mapped.current = frames.value;
	const usable = link.map.outcome === 'linked';
	useEffect(() => {
		const open = (/** @type {Side} */ which) => {
			const { id, sha256, frames: count, fps } = recordings[which];
			return players[which].openFilm({ id, sha256, frames: count ?? 0, fps: fps ?? 25, first: first[which].first, last: first[which].last });
		};
		const ends = [open('live'), open('replay')];
		for (const which of /** @type {Side[]} */ (['live', 'replay'])) if (param(which)) players[which].goTo(Number(param(which)) || 0);
		return () => { for (const end of ends) end(); };
	}, [first.id]);
	useFramesInAddress(first.id, players);
	useEffect(() => { if (!usable) setTogether(false); }, [usable]);
	const follows = useRef(false);
	follows.current = together && usable;
	useSignalEffect(() => {
		const live = players.live.wanted.value;
		const frame = follows.current && mapped.current ? replayFrameAt(mapped.current, live) : null;
		if (frame !== null) players.replay.goTo(frame);
	});
	/** @param {Side} which */
	function focus(which) {
		setSide(which);
		// Whoever moves the replay by itself does not want it moved.
		if (which === 'replay') setTogether(false);
	}
	function linkHere() {
		const pair = { live: players.live.wanted.value, replay: players.replay.wanted.value };
		change(({ instants, assumed_speed }) => ({ instants: withInstant(instants, pair), assumed_speed }), `Live frame ${pair.live} is linked to frame ${pair.replay} of the replay.`);
	}
	/** @param {number} replay frame */
	function remove(replay) {
		change(({ instants, assumed_speed }) => ({ instants: instants.filter((one) => one.replay !== replay), assumed_speed }), 'The instant is removed.');
	}
	/** @param {InstantPair} one */
	function show({ live, replay }) {
		setTogether(false);
		for (const player of [players.live, players.replay]) player.stand();
		players.live.goTo(live);
		players.replay.goTo(replay);
	}
	function playTogether() {
		if (!usable) { explain(whyApart(link)); return; }
		const next = !together;
		setTogether(next);
		setSide('live');
		players.replay.stand();
		follows.current = next;
		if (!next) {
			players.live.stand();
			return;
		}
		const start = mapped.current?.replay.findIndex((frame) => frame !== null) ?? -1;
		const last = mapped.current?.replay.findLastIndex((frame) => frame !== null) ?? -1;
		const at = players.live.wanted.value;
		const here = mapped.current && replayFrameAt(mapped.current, at);
		// From where both show something, and go on.
		if (mapped.current && start >= 0 && (here === null || at + END > mapped.current.first + last)) players.live.goTo(mapped.current.first + start);
		else if (here !== null) players.replay.goTo(here);
		if (!players.live.speed.value) players.live.run(1);
	}
	/** @param {1 | -1} way */
	function showBeside(way) {
		const next = instantBeside(link.instants, side, players[side].wanted.value, way);
		if (next) show(next);
		else explain(`No linked instant comes ${way < 0 ? 'before' : 'after'} this frame.`);
	}
	const doing = useRef({ player: players.live, focus, linkHere, playTogether, showBeside, undo, second: 25 });
	doing.current = { player: players[side], focus, linkHere, playTogether, showBeside, undo, second: Math.round(recordings[side].fps ?? 25) };
	const keys = useMemo(() => keysOfLink(doing), []);
	useKeys(keys);
	const dataset = recordings.live.dataset;
	const here = link.instants.find((one) => one.replay === players.replay.wanted.value && one.live === players.live.wanted.value);
	return html`
		<div class="linking">
			${/** @type {Side[]} */ (['live', 'replay']).map((which) => html`
				<${Stage}
					key=${which} side=${which} shot=${link[which]} player=${players[which]} one=${recordings[which]} focused=${side === which} focus=${() => focus(which)}
					mark=${which === 'replay' ? markOf(frames.value, players.replay.wanted.value) : ''}
				/>`)}
			<${TimesCard} link=${link} frames=${frames.value} fps=${recordings.live.fps ?? 25} dataset=${dataset} assume=${(/** @type {number} */ speed) => change(({ instants }) => ({ instants, assumed_speed: speed }), 'The speed is assumed.')}>
				<p class="buttons">
					<button class="button button--primary" type="button" data-needs="annotate" data-of=${dataset} aria-disabled=${Boolean(here)} title=${here ? 'These two frames are linked already' : 'Link these two frames: both show the same instant'} onClick=${() => { if (!here) linkHere(); }}>Same instant <kbd>I</kbd></button>
					<button class="button" type="button" aria-pressed=${together} aria-disabled=${!usable} title=${whyApart(link).replace(/\.$/, '')} onClick=${playTogether}>Play together <kbd>P</kbd></button>
				</p>
			<//>
			<${InstantsList} link=${link} dataset=${dataset} show=${show} remove=${remove}>
				<p class="linking__remove"><${ConfirmButton}
					small=${true} needs="annotate" of=${dataset} label="Remove this link" question=${`Remove the link with its ${plural(link.instants.length, 'instant')}? Groups made with it stay.`} what=""
					run=${() => attempt(deleteLink(link.live.recording, link.id), () => navigate(`/recordings/${link.replay.recording}`))}
				/></p>
				${error ? html`<${FormError} error=${error} />` : null}
			<//>
			<${BallCard} link=${link} dataset=${dataset} reload=${reload} />
		</div>
	`;
}

export function LinkPage() {
	const { recording, link } = page.value.page === 'link' ? page.value : { recording: 0, link: 0 };
	const found = useResource(async (signal) => {
		const first = await getLink(recording, link, signal);
		const [live, replay] = await Promise.all([getRecording(first.live.recording, signal), getRecording(first.replay.recording, signal)]);
		return { first, recordings: { live, replay } };
	}, [recording, link]);
	// The answer about the link before stays until the next one is there: no key may act on it.
	const one = found.value?.first.id === link ? found.value : null;
	const why = one && (one.recordings.live.problem ?? one.recordings.replay.problem);
	const back = one?.first.replay;
	useEffect(() => { if (one) useDataset(one.recordings.live.dataset); }, [one]);
	return html`
		<${PageFrame} current="recordings" title="Link a replay" where=${html`<a href="/recordings">Recordings</a>${back ? html` / <a href=${`/recordings/${back.recording}`}>${back.name}</a> / <strong>replay ${back.first} to ${back.last}</strong>` : null}`}>
			${found.error ? html`<${Trouble} title="This link cannot be shown" error=${found.error} retry=${found.reload} />` : null}
			${!one && !found.error ? html`<${Loading} what="the link" />` : null}
			${why ? html`<section class="card empty" role="alert"><h2>The frames cannot be read now</h2><p>${why}</p></section>` : null}
			${one && !why ? html`<${Both} key=${one.first.id} first=${one.first} recordings=${one.recordings} />` : null}
		<//>
	`;
}
