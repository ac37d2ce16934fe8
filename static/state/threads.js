// @ts-check
/** What people say to each other about the group on screen, and what is being said. */

import { computed, effect, signal, untracked } from '@preact/signals';

import { listen } from '../api/events.js';
import { ApiError } from '../api/problem.js';
import { getThreads } from '../api/threads.js';
import { page, param } from '../lib/router.js';
import { stored } from '../lib/storage.js';
import { groupDocument } from './group.js';
import { refuses } from './rights.js';
import { pointerPlace } from './workspace.js';

/** @import {ThreadJson} from '../api/threads.js' */
/** @import {PlaceOfComment} from '../views/comments/comment_field.js' */
/** @import {ViewPicture} from '../overlays/scene.js' */

/** People who go through easy groups stay shorter than this, ms. */
const STAY = 300;

/** The threads of a group; of another one than is on screen until they are read. */
const known = signal(/** @type {{group: number, items: ThreadJson[]}} */ ({ group: 0, items: [] }));

const shown = computed(() => (page.value.page === 'review' ? groupDocument.value?.id ?? null : null));

/** Threads of the group on screen; null until they are known. */
export const threads = computed(() => (known.value.group === shown.value ? known.value.items : null));

/** How many of them are open. */
export const openThreads = computed(() => (threads.value ?? []).filter(({ resolved }) => !resolved).length);

/** Where somebody begins to say something; null: nowhere. `time` tells two wishes apart. */
export const composing = signal(/** @type {{place: PlaceOfComment | null, time: number} | null} */ (null));

/** Comments that are begun and not sent, by the group and the field. */
const drafts = stored('comment-drafts', /** @type {Record<string, string>} */ ({}), 'sessionStorage');

/** @param {number} group @param {string} field its id: names the thread or the comment @returns {string} "" where nothing is begun */
export function commentDraft(group, field) {
	return drafts.value[`${group} ${field}`] ?? '';
}

/** @param {number} group @param {string} field @param {string} text "": it is sent, or given up */
export function keepCommentDraft(group, field, text) {
	const { [`${group} ${field}`]: _, ...rest } = drafts.value;
	drafts.value = text.trim() ? { ...rest, [`${group} ${field}`]: text } : rest;
}

/** Say something where the pointer is, or about the group. */
export function compose() {
	if (refuses('annotate', groupDocument.value?.dataset.name)) return;
	composing.value = { place: pointerPlace.value, time: Date.now() };
}

/** Read the threads of a group once more. @param {number} group */
export async function readThreads(group) {
	try {
		const { items } = await getThreads(group);
		if (shown.value === group) known.value = { group, items };
	} catch (error) {
		// The next visit, or what is told next, reads them again.
		if (!(error instanceof ApiError)) throw error;
	}
}

/** Follow the group on screen, and what others say about it. */
export function startThreads() {
	effect(() => {
		const group = shown.value;
		if (group === null) return undefined;
		return untracked(() => {
			composing.value = null;
			const read = () => { readThreads(group); };
			const timer = setTimeout(read, param('thread') ? 0 : STAY);
			const deaf = listen('group', (told) => { if (told.group === group && told.kind === 'comment') read(); }, read);
			return () => { clearTimeout(timer); deaf(); };
		});
	});
}

/** Pictures with a pin where a thread is open. @param {ViewPicture[]} pictures @param {ThreadJson[] | null} items @returns {ViewPicture[]} */
export function withThreads(pictures, items) {
	const placed = (items ?? []).filter(({ at, resolved }) => at && !resolved);
	if (placed.length === 0) return pictures;
	return pictures.map((picture) => ({
		...picture,
		pins: [...picture.pins, ...placed.filter(({ view }) => view === picture.view.key).map(pinOf)],
	}));
}

/** @param {ThreadJson} thread */
function pinOf({ at, comments }) {
	const said = comments.find(({ text }) => text)?.text ?? '';
	const [line] = said.split('\n');
	return { at: /** @type {{x: number, y: number}} */ (at), text: line.length > 40 ? `${line.slice(0, 39)}…` : line };
}
