// @ts-check
/** The way to following a ball: what few need is fetched when somebody follows one. */

import { signal } from '@preact/signals';
import { useMemo } from 'preact/hooks';

import { lazy } from '../lib/lazy.js';
import { explain } from '../state/notice.js';

/** @import {ViewJson} from '../api/types.js' */
/** @import {ViewPicture} from '../overlays/scene.js' */

/** @typedef {typeof import('../state/follow.js') & typeof import('../overlays/followed.js')} Loaded */

const loaded = signal(/** @type {Loaded | null} */ (null));

export const FollowCard = lazy(async () => (await import('./follow_card.js')).FollowCard);

/** Whether a ball is being followed, or was and is not put away. */
export function isFollowing() {
	return Boolean(loaded.value?.follow.value);
}

/** Follow the ball of a view; again: accept what is sure. @param {ViewJson | undefined} view */
export async function followOrAccept(view) {
	const parts = loaded.value ?? await load();
	if (!parts) explain('The server cannot be reached.');
	else if (parts.follow.value && (!view || parts.isOfCamera(view))) parts.acceptFollowed(parts.sure.value);
	else if (view) parts.startFollow(view);
}

/** Follow the ball of a view, whatever was followed before. @param {ViewJson} view */
export async function followAnew(view) {
	const parts = loaded.value ?? await load();
	if (parts) parts.startFollow(view);
	else explain('The server cannot be reached.');
}

/** Leave what is being followed. */
export function leaveFollow() {
	loaded.value?.endFollow();
}

/** Accept the followed ball of a view on screen. @param {ViewJson | undefined} view @returns {boolean} whether there is one */
export function acceptFollowedHere(view) {
	return Boolean(view && loaded.value?.acceptHere(view));
}

async function load() {
	try {
		const [state, overlay] = await Promise.all([import('../state/follow.js'), import('../overlays/followed.js')]);
		loaded.value = { ...state, ...overlay };
	} catch {
		// The server is away: the next press tries again.
	}
	return loaded.value;
}

/** The pictures with the followed balls of their camera. @param {ViewPicture[]} pictures @returns {ViewPicture[]} */
export function useFollowed(pictures) {
	const parts = loaded.value;
	const shown = parts?.follow.value ?? null;
	return useMemo(() => (!shown || !parts ? pictures : pictures.map((picture) => {
		const items = parts.itemsOf(picture.view);
		return items.length ? { ...picture, followed: parts.followedDrawing(items) } : picture;
	})), [pictures, shown, parts]);
}
