// @ts-check
/** Videos on their way to the server: sent part by part, one after the other, on from where the server is. */

import { signal } from '@preact/signals';

import { beginUpload, deleteUpload, getUploads, sendPart } from '../api/imports.js';
import { ApiError, sentenceOf } from '../api/problem.js';
import { postRecording } from '../api/recordings.js';
import { isVideo } from '../lib/local_files.js';
import { follow } from './jobs.js';

/** @import {UploadJson} from '../api/imports.js' */
/** @import {JobJson} from '../api/jobs.js' */

/**
 * @typedef {object} VideoUpload
 * @property {number} key
 * @property {string} name
 * @property {number} size bytes
 * @property {number} bytes how many the server has
 * @property {'queued' | 'sending' | 'waiting' | 'half' | 'here' | 'refused' | 'added'} state waiting: the server is away; half: its file has to be chosen again
 * @property {string} error why it was refused, or waits
 * @property {string | null} id of the upload, once the server knows it
 * @property {number | null} left seconds until all is there, where that can be told
 * @property {File | null} file
 * @property {string | null} dataset to which it goes when it is here
 * @property {JobJson | null} job that indexes it
 * @property {AbortController} sending
 */

/** Bytes of a part: what a lost connection costs at most, beside what the server has kept of it. */
const PART = 32 * 2 ** 20;
const FIRST_PAUSE = 500;
const LONGEST_PAUSE = 10_000;
/** Seconds after which it can be told how long the rest takes. */
const SURE = 3;
/** The server or the way to it is away for a while. */
const PASSING = [0, 408, 409, 429, 502, 503, 504];

/** @type {import('@preact/signals').Signal<VideoUpload[]>} */
export const videoUploads = signal(/** @type {VideoUpload[]} */ ([]));
/** Days after its last part until a half-sent one is deleted. */
export const uploadDays = signal(0);

let keys = 0;
let line = Promise.resolve();

/** @param {Partial<VideoUpload> & {name: string, size: number}} known @returns {VideoUpload} */
function made(known) {
	keys += 1;
	return { key: keys, bytes: 0, state: 'queued', error: '', id: null, left: null, file: null, dataset: null, job: null, sending: new AbortController(), ...known };
}

/** @param {number} key @param {Partial<VideoUpload>} changes */
function change(key, changes) {
	videoUploads.value = videoUploads.value.map((one) => (one.key === key ? { ...one, ...changes } : one));
}

/** @param {number} key @returns {VideoUpload | undefined} */
const known = (key) => videoUploads.value.find((one) => one.key === key);

/** What the server has of earlier visits: videos that are half sent, and those that are no recording yet. */
export async function findUploads() {
	const { items, days } = await getUploads();
	uploadDays.value = days;
	const here = new Set(videoUploads.value.map(({ id }) => id));
	const fresh = items.filter((one) => !one.kept && !here.has(one.id) && isVideo(one.name));
	videoUploads.value = [...videoUploads.value, ...fresh.map(({ id, name, size, bytes }) => made({ id, name, size, bytes, state: bytes < size ? 'half' : 'here' }))];
}

/** Send videos, each after those before it. @param {File[]} files */
export function sendVideos(files) {
	for (const file of files) {
		const one = made({ name: file.name, size: file.size, file });
		videoUploads.value = [...videoUploads.value, one];
		queue(one.key);
	}
}

/** Once more, after it was refused. @param {VideoUpload} one */
export function sendAgain({ key, file }) {
	change(key, { state: file ? 'queued' : 'here', error: '', sending: new AbortController() });
	if (file) queue(key);
	else add(key);
}

/** @param {number} key */
function queue(key) {
	line = line.then(() => send(key)).catch(() => {});
}

/** Give those that are here, or will be, to a dataset. @param {string} dataset */
export function addVideos(dataset) {
	for (const { key, state, dataset: its } of videoUploads.value) {
		if (its !== null || state === 'half' || state === 'added') continue;
		change(key, { dataset });
		if (state === 'here') add(key);
	}
}

/** Send it no further, and keep nothing of it. @param {VideoUpload} one */
export async function dropVideo({ key, id, state, sending }) {
	sending.abort();
	videoUploads.value = videoUploads.value.filter((other) => other.key !== key);
	if (id && state !== 'added') await deleteUpload(id).catch(() => {});
}

/** @param {number} key */
async function send(key) {
	const one = known(key);
	if (!one?.file) return;
	const { file, sending: { signal: over } } = one;
	try {
		const sent = await allOf(file, (changes) => {
			// The file of one that was half sent is known again by its id.
			if (changes.id) videoUploads.value = videoUploads.value.filter((other) => other.key === key || other.id !== changes.id);
			change(key, changes);
		}, over);
		change(key, { state: 'here', bytes: sent.size });
		if (known(key)?.dataset) await add(key);
	} catch (error) {
		if (!over.aborted) change(key, { state: 'refused', error: sentenceOf(error) });
	}
}

/** @param {File} file @param {(changes: Partial<VideoUpload>) => void} tell @param {AbortSignal} over @returns {Promise<UploadJson>} */
async function allOf(file, tell, over) {
	/** @type {UploadJson | null} */
	let found = null;
	let pause = FIRST_PAUSE;
	/** When, and with how many bytes, it began to go without a stop. */
	let since = { at: 0, bytes: 0 };
	/** @param {number} bytes */
	const moved = (bytes) => {
		const seconds = (performance.now() - since.at) / 1000;
		const rate = (bytes - since.bytes) / seconds;
		tell({ bytes, left: seconds > SURE && rate > 0 ? (file.size - bytes) / rate : null });
	};
	for (;;) {
		over.throwIfAborted();
		try {
			if (!found) {
				found = await beginUpload(file, over);
				since = { at: performance.now(), bytes: found.bytes };
			}
			const { id, bytes, size } = found;
			tell({ id, bytes, state: 'sending', error: '' });
			if (bytes === size) return found;
			const part = file.slice(bytes, bytes + PART);
			found = await sendPart(id, bytes, part, (share) => moved(bytes + Math.round(share * part.size)), over);
			pause = FIRST_PAUSE;
		} catch (error) {
			if (!(error instanceof ApiError) || !PASSING.includes(error.status)) throw error;
			await readable(file);
			// Behind status 0 there is no answer: the server or the way to it is away.
			tell({ state: 'waiting', error: error.status ? sentenceOf(error) : '' });
			await rest(pause, over);
			pause = Math.min(2 * pause, LONGEST_PAUSE);
			found = null;
		}
	}
}

/** Throws where it is the file that cannot be sent: browsers say no more of it than of a lost connection. @param {File} file */
async function readable(file) {
	try {
		await file.slice(0, 1).arrayBuffer();
	} catch {
		throw new Error(`${file.name} has changed or is gone: choose it again`);
	}
}

/** @param {number} pause milliseconds, less where the network comes back @param {AbortSignal} over */
function rest(pause, over) {
	return new Promise((resolve) => {
		const wake = () => {
			clearTimeout(timer);
			removeEventListener('online', wake);
			over.removeEventListener('abort', wake);
			resolve(null);
		};
		const timer = setTimeout(wake, pause);
		addEventListener('online', wake);
		over.addEventListener('abort', wake);
	});
}

/** Make it a recording, and follow the job that finds its shots. @param {number} key */
async function add(key) {
	const one = known(key);
	if (!one?.id || !one.dataset) return;
	try {
		const job = await postRecording({ dataset: one.dataset, source: { upload: one.id } });
		change(key, { state: 'added', job });
		follow(job, (seen) => change(key, { job: seen })).catch(() => {});
	} catch (error) {
		change(key, { state: 'refused', error: sentenceOf(error), file: null });
	}
}
