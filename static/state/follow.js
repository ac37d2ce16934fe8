// @ts-check
/**
 * The ball of a view followed through the frames of its camera into the groups before and after. What is found is shown
 * and counts for nothing until it is accepted.
 */

import { computed, signal } from '@preact/signals';

import { getGroup } from '../api/client.js';
import { ApiError } from '../api/problem.js';
import { editBalls, followBall } from '../api/follow.js';
import { ballCenter, ballOf } from '../geometry/preview.js';
import { plural } from '../lib/format.js';
import { navigate } from '../lib/router.js';
import { loadDatasets } from './datasets.js';
import { group, groupDocument, open } from './group.js';
import { did, didAgain, forget, forgetUndone, tookBack } from './last_action.js';
import { reviewAddress } from './navigation.js';
import { announce, complain, explain, inform } from './notice.js';
import { refuses } from './rights.js';

/** @import {FollowedBall, FollowedItem} from '../api/follow.js' */
/** @import {ViewJson} from '../api/types.js' */
/** @import {FollowDone} from './last_action.js' */

const GONE = new Set([403, 404, 409, 422]);

/** @typedef {{dataset: string, camera: string, letter: string, station: number, found: FollowedBall | null}} Follow   `found`: null while it is followed */

/** What is being followed, or was and is not put away. */
export const follow = signal(/** @type {Follow | null} */ (null));
/** What can be accepted without a look. */
export const sure = computed(() => itemsIn('followed'));
/** What a person has to look at. */
export const unsure = computed(() => itemsIn('uncertain'));

let stop = new AbortController();
/** Whether followed balls are on their way to the server. */
let isSending = false;

/** @param {FollowedItem['state']} state @returns {FollowedItem[]} */
function itemsIn(state) {
	return (follow.value?.found?.items ?? []).filter((item) => item.state === state);
}

/** Whether the camera of a view on screen is the one that was followed. @param {ViewJson} view */
export function isOfCamera(view) {
	const at = follow.value;
	return at !== null && at.station === view.station.id && at.dataset === groupDocument.value?.dataset.name;
}

/** The followed balls of a view's camera, where it is the one. @param {ViewJson} view @returns {FollowedItem[]} */
export function itemsOf(view) {
	return (isOfCamera(view) && follow.value?.found?.items) || [];
}

/** Follow the ball of a view. @param {ViewJson} view */
export async function startFollow(view) {
	const dataset = group.value?.dataset.name;
	if (!dataset || refuses('annotate', dataset)) return;
	const ball = ballOf(view);
	const center = ball && ballCenter(ball);
	if (!center) return complain(`View ${view.letter} has no ball to follow. Press N to draw it.`);
	const { id: station, shared } = view.station;
	if (!shared) return complain(`The camera of view ${view.letter} is not static. A ball can be followed through groups of static cameras, and in the player of a recording.`);
	stop.abort();
	const mine = new AbortController();
	stop = mine;
	follow.value = { dataset, camera: view.label, letter: view.letter, station, found: null };
	announce(`Following the ball of view ${view.letter}…`);
	try {
		const found = await followBall(view.id, [center.x, center.y], mine.signal);
		if (mine.signal.aborted) return undefined;
		tell(found);
	} catch (error) {
		if (mine.signal.aborted) return undefined;
		follow.value = null;
		if (!(error instanceof ApiError)) throw error;
		complain(`The ball of view ${view.letter} cannot be followed: ${error.message}`);
	}
	return undefined;
}

/** @param {FollowedBall} found */
function tell(found) {
	if (follow.value && found.items.length) {
		follow.value = { ...follow.value, found };
		const rest = unsure.value.length ? `, ${unsure.value.length} of them uncertain` : '';
		announce(`The ball was found in ${plural(found.items.length, 'more view')} of this camera${rest}.`);
		return;
	}
	follow.value = null;
	const known = found.before === 'known' || found.after === 'known';
	inform(known ? 'The ball was not followed further: the groups before or after already have a ball, which is kept.'
		: 'The ball was not found in the frames before and after.');
}

/** Put away what was followed, or leave it. */
export function endFollow() {
	stop.abort();
	follow.value = null;
	announce('The positions of the followed ball that were not accepted are discarded.');
}

/** Make followed balls those of their views. @param {FollowedItem[]} items */
export async function acceptFollowed(items) {
	const at = follow.value;
	if (!at?.found) return explain('The ball is still being followed.');
	if (isSending) return explain('The balls are being placed.');
	if (items.length === 0) return complain('The remaining views are uncertain: check each, and accept it with Y.');
	const from = at.found.group;
	/** @type {FollowDone} */
	const action = {
		kind: 'follow', dataset: at.dataset, from, text: `${plural(items.length, 'ball')} followed from group ${from}`,
		items: items.map(({ group: id, view, etag, box }) => ({ group: id, view, etag, box })),
	};
	const asked = new Set(items.map(({ view }) => view));
	const left = at.found.items.filter(({ view }) => !asked.has(view));
	isSending = true;
	const done = await send(action, true).finally(() => { isSending = false; });
	if (!done) return undefined;
	// Meanwhile it may have been dismissed, or another ball followed.
	if (follow.value === at) follow.value = left.length ? { ...at, found: { ...at.found, items: left } } : null;
	if (!done.changed) return complain(`No ball was placed.${stayed(done.refused)} Follow the ball again.`);
	did(done.action);
	inform(`${plural(done.changed, 'ball')} placed in ${at.camera}.${stayed(done.refused)}`, { label: 'Undo', run: () => undoFollow(done.action) });
	return undefined;
}

/** Accept the followed ball of the group on screen. @param {ViewJson} view @returns {boolean} whether there is one */
export function acceptHere(view) {
	const item = view.balls.length === 0 && itemsOf(view).find((one) => one.view === view.id);
	// The group may have been edited since the ball was followed: what is on screen is what is accepted.
	if (item) acceptFollowed([{ ...item, etag: groupDocument.value?.etag ?? item.etag }]);
	return Boolean(item);
}

/** Go to the next group that a person has to look at, from the first again behind the last. */
export function nextUnsure() {
	const here = group.value?.number ?? 0;
	const next = unsure.value.find(({ number }) => number > here) ?? unsure.value[0];
	if (next) navigate(reviewAddress(next.group));
}

/** Take accepted balls away again; a ball that was edited since stays. @param {FollowDone} action */
export async function undoFollow(action) {
	const done = await send(action, false);
	if (!done) return;
	forget(action);
	if (done.changed) tookBack(done.action);
	inform(`${plural(done.changed, 'ball')} removed again.${stayed(done.refused)}`, done.changed ? { label: 'Redo', run: () => redoFollow(done.action) } : undefined);
}

/** Place balls again that were taken away. @param {FollowDone} action */
export async function redoFollow(action) {
	const done = await send(action, true);
	if (!done) return;
	if (done.changed) didAgain(action, done.action);
	else forgetUndone(action);
	inform(`${plural(done.changed, 'ball')} placed again.${stayed(done.refused)}`);
}

/**
 * @param {FollowDone} action @param {boolean} placed whether the balls are there afterwards
 * @returns {Promise<{action: FollowDone, changed: number, refused: number} | null>} with what was changed, as it is now
 */
async function send(action, placed) {
	try {
		const first = await edit(action, placed, action.items);
		// A group that was judged or edited elsewhere since is no reason to keep a ball that is to go.
		const again = placed ? [] : await stillPlaced(first.left);
		const second = again.length ? await edit(action, placed, again) : { kept: [], left: [] };
		const kept = [...first.kept, ...second.kept];
		if (groupDocument.value) open(groupDocument.value.id);
		loadDatasets();
		return { action: { ...action, items: kept }, changed: kept.length, refused: action.items.length - kept.length };
	} catch (error) {
		if (!(error instanceof ApiError)) throw error;
		complain(`Not done: ${error.message}`);
		// What the server cannot do it cannot do the next time either.
		return GONE.has(error.status) ? { action: { ...action, items: [] }, changed: 0, refused: action.items.length } : null;
	}
}

/**
 * @param {FollowDone} action @param {boolean} placed @param {FollowDone['items']} items
 * @returns {Promise<{kept: FollowDone['items'], left: FollowDone['items']}>} what was changed, as it is now, and what was not
 */
async function edit({ dataset, from }, placed, items) {
	const done = await editBalls(dataset, items.map(({ view, etag, box }) => ({ view, etag, ball: placed ? { box, followed_from: from } : null })));
	const isDone = (/** @type {number} */ i) => done.items[i]?.outcome === 'changed';
	return {
		kept: items.flatMap((item, i) => (isDone(i) ? [{ ...item, etag: done.items[i].etag ?? item.etag }] : [])),
		left: items.filter((_, i) => !isDone(i)),
	};
}

/** Those of some balls that are still where they were placed, with their groups as they are now. @param {FollowDone['items']} items @returns {Promise<FollowDone['items']>} */
async function stillPlaced(items) {
	const found = await Promise.all(items.map(async (item) => {
		try {
			const { views, etag } = await getGroup(item.group);
			const balls = views.find(({ id }) => id === item.view)?.balls ?? [];
			return balls.length === 1 && String(balls[0].box) === String(item.box) ? [{ ...item, etag }] : [];
		} catch (error) {
			if (error instanceof ApiError) return [];
			throw error;
		}
	}));
	return found.flat();
}

/** Views that stay as they are, as a sentence; '' for none. @param {number} views */
function stayed(views) {
	return views ? ` ${plural(views, 'group')} ${views === 1 ? 'was' : 'were'} changed meanwhile and ${views === 1 ? 'stays' : 'stay'} as ${views === 1 ? 'it is' : 'they are'}.` : '';
}
