// @ts-check
/**
 * Writes that the server has not answered yet. They are kept in the browser's database until it
 * has, so that neither a lost network nor a reload loses one.
 */

import { computed, signal } from '@preact/signals';
import { openDB } from 'idb';

import { idempotencyKey } from '../api/client.js';
import { stored } from '../lib/storage.js';
import { myName } from './me.js';

/** @import {BallJson, LeftOutJson, PointJson, VerdictJson} from '../api/types.js' */
/** @import {Edit} from './edits.js' */

/** @typedef {{state: string, reason: string | null, note: string | null}} Verdict */
/** @typedef {{field: 'undo_of' | 'redo_of', key: string}} Turn   undo or redo of the verdict that a write of that key gave */
/** @typedef {{lines: Record<string, PointJson[] | null>, not_visible?: string[], balls: BallJson[], included: boolean, left_out?: LeftOutJson | null, picture?: unknown, verdict: VerdictJson, views?: Record<string, Base>}} Base   of one view; `views`: of all, by their keys */
/**
 * @typedef {object} Item
 * @property {string} id idempotency key: sent twice it counts once
 * @property {string} tab the tab that looks after it
 * @property {number} at when it was made, for the order
 * @property {number} group
 * @property {string} path
 * @property {'PATCH' | 'PUT' | 'POST'} method
 * @property {unknown} body
 * @property {string} etag the state that it builds on
 * @property {number | null} station the static camera whose state that is, else the group's
 * @property {Edit | null} edit
 * @property {Verdict | null} verdict
 * @property {Turn} [turn] what undoes or redoes a verdict
 * @property {Base | null} base what the edit or verdict found
 * @property {string | null} person who made it; null where nobody logs in
 * @property {string} [barred] why the person may not; it waits until they may, or drop it
 * @property {boolean} held somebody else was first; it waits for the person to choose
 */

const STORE = 'writes';
/** How long the browser's database may take before a write is sent without it, ms. */
const PATIENCE = 5000;

/** Those of this tab, in their order. */
export const outbox = signal(/** @type {Item[]} */ ([]));
/** Whether what waits would survive the end of the page. */
export const lasting = signal(true);

const tab = idempotencyKey();
const lastTab = stored('tab', '', 'sessionStorage');
/** What the page before this one was called, where this one is loaded anew. */
const predecessor = lastTab.value;

/** @type {Promise<import('idb').IDBPDatabase | null> | null} */
let opened = null;

/** The database; null where the browser has none for us. */
function database() {
	opened ??= openDB('touchline', 1, {
		upgrade: (db) => { db.createObjectStore(STORE, { keyPath: 'id' }); },
		// The browser may close it at any time, to make room for instance.
		terminated: () => { opened = null; },
	}).catch(() => {
		lasting.value = false;
		return null;
	});
	return opened;
}

/** @param {(db: import('idb').IDBPDatabase) => Promise<unknown>} work */
async function inDatabase(work) {
	const db = await database();
	if (db) await work(db).catch(() => { lasting.value = false; });
}

/** Those that are on their way into the database. @type {Map<string, Promise<void>>} */
const keeping = new Map();

/**
 * Wait until a write is in the browser's database: one that is sent before it is kept is lost when
 * the page is loaded anew while it is on its way. A database that takes too long is none.
 *
 * @param {Item} item
 */
export async function isKept({ id }) {
	const kept = keeping.get(id);
	if (!kept || !lasting.value) return;
	const late = new Promise((done) => { setTimeout(done, PATIENCE, 'late'); });
	if (await Promise.race([kept, late]) === 'late') lasting.value = false;
}

/** Put a write last. @param {Omit<Item, 'id' | 'tab' | 'at' | 'person' | 'held'>} write @returns {Item} */
export function enqueue(write) {
	const at = performance.timeOrigin + performance.now();
	const item = { ...write, id: idempotencyKey(), tab, at, person: myName.value, held: false };
	outbox.value = [...outbox.value, item];
	keeping.set(item.id, inDatabase((db) => db.put(STORE, item)).finally(() => keeping.delete(item.id)));
	return item;
}

/** Change some writes. @param {(item: Item) => Item} change the same value where nothing changes */
export function revise(change) {
	const next = outbox.value.map(change);
	const changed = next.filter((item, i) => item !== outbox.value[i]);
	if (changed.length === 0) return;
	outbox.value = next;
	inDatabase((db) => Promise.all(changed.map((item) => db.put(STORE, item))));
}

/** Forget writes. @param {(item: Item) => boolean} which */
export function discard(which) {
	const gone = outbox.value.filter(which);
	if (gone.length === 0) return;
	outbox.value = outbox.value.filter((item) => !gone.includes(item));
	inDatabase((db) => Promise.all(gone.map(({ id }) => db.delete(STORE, id))));
}

/**
 * Writes of one group that come to nothing together: edits that an undo behind them takes back, and every such undo and redo.
 *
 * @param {Item[]} writes in their order @returns {Item[]}
 */
export function takenBack(writes) {
	/** @type {Item[]} */
	const back = [];
	for (const [place, write] of writes.entries()) {
		if (write.edit || write.method !== 'POST') continue;
		// The edits of a static camera have a line of their own.
		const before = writes.slice(0, place).filter(({ edit, station }) => edit && station === write.station);
		const last = before.findLast((edit) => !back.includes(edit));
		const again = back.findLast((edit) => before.includes(edit));
		if (write.path.includes('/undo') && last) back.push(last);
		// A new edit leaves nothing to do again.
		else if (write.path.includes('/redo') && again && last !== before.at(-1)) back.splice(back.indexOf(again), 1);
	}
	return writes.filter((write) => back.includes(write) || (!write.edit && write.method === 'POST'));
}

/** Say that this tab lives, so that no other sends what it looks after. */
export function claimTab() {
	lastTab.value = tab;
	navigator.locks?.request(lockOf(tab), () => new Promise(() => {}));
}

/** Wait for the end of a page; one that lives on, as beside a doubled tab, is waited for in vain. @param {string} other */
async function hasEnded(other) {
	const signal = AbortSignal.timeout(PATIENCE);
	return navigator.locks.request(lockOf(other), { signal }, () => true).catch(() => false);
}

/** Tabs whose end is waited for. @type {Set<string>} */
const watched = new Set();

/** @param {string} other @param {() => void} then */
function hearEnd(other, then) {
	if (watched.has(other)) return;
	watched.add(other);
	navigator.locks.request(lockOf(other), () => { watched.delete(other); }).then(then);
}

/**
 * Take over what tabs have left that are gone, a reload's predecessor among them.
 *
 * @param {() => void} again called when one is gone that still lives and looks after writes
 */
export async function adopt(again) {
	const db = await database();
	const kept = /** @type {Item[]} */ ((await db?.getAll(STORE).catch(() => [])) ?? []);
	const held = (await navigator.locks?.query())?.held ?? [];
	const alive = new Set(held.map(({ name }) => name));
	const isLeaving = alive.has(lockOf(predecessor)) && kept.some((item) => item.tab === predecessor);
	if (isLeaving && await hasEnded(predecessor)) alive.delete(lockOf(predecessor));
	const own = new Set(outbox.value.map(({ id }) => id));
	// What somebody else has left waits for them.
	const others = kept.filter((item) => item.tab !== tab && (item.person ?? null) === myName.value && !own.has(item.id));
	for (const { tab: other } of others) if (alive.has(lockOf(other))) hearEnd(other, again);
	const orphans = others.filter((item) => !alive.has(lockOf(item.tab)));
	if (orphans.length === 0) return;
	const adopted = orphans.map((item) => ({ ...item, tab })).sort((a, b) => a.at - b.at);
	outbox.value = [...adopted, ...outbox.value];
	await inDatabase((one) => Promise.all(adopted.map((item) => one.put(STORE, item))));
}

/** Writes that the person may not make any more, or not yet. */
export const barred = computed(() => outbox.value.filter((item) => item.barred));

/** Try again what somebody was not allowed. */
export function unbar() {
	revise((item) => (item.barred ? { ...item, barred: undefined } : item));
}

/** @param {string} name */
function lockOf(name) {
	return `touchline-tab-${name}`;
}
