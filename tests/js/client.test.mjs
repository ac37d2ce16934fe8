/** Requests: what comes of an answer whose body cannot be read. */

import assert from 'node:assert/strict';
import test from 'node:test';

import { cameIn, loggedOut, request } from '../../static/api/client.js';

/** An answer whose body ends so. @param {number} status @param {() => Promise<any>} json */
function answers(status, json) {
	globalThis.fetch = async () => /** @type {any} */ ({ ok: status < 400, status, headers: new Headers(), json });
}

test('a reader who has gone while the body came gets no answer', async () => {
	const gone = new AbortController();
	answers(200, async () => { gone.abort(); throw new DOMException('gone', 'AbortError'); });
	await assert.rejects(request('/jobs', { signal: gone.signal }), { name: 'AbortError' });
});

test('a connection that ends amid the body is a server that is away', async () => {
	answers(200, async () => { throw new TypeError('network error'); });
	await assert.rejects(request('/jobs'), { status: 0 });
});

test('an answer without a body is none', async () => {
	answers(204, async () => { throw new SyntaxError('Unexpected end of JSON input'); });
	assert.equal(await request('/jobs/1', { method: 'DELETE' }), null);
});

test('a refusal without a body keeps its status', async () => {
	answers(503, async () => { throw new SyntaxError('Unexpected end of JSON input'); });
	await assert.rejects(request('/jobs'), { status: 503 });
});

test('a refusal that comes after somebody has logged in again does not ask them once more', async () => {
	/** @type {(answer: any) => void} */
	let answer = () => {};
	globalThis.fetch = () => new Promise((resolve) => { answer = resolve; });
	const refused = { ok: false, status: 401, headers: new Headers(), json: async () => ({}) };
	const late = request('/jobs');
	loggedOut.value = true;
	cameIn();
	answer(refused);
	await assert.rejects(late, { status: 401 });
	assert.equal(loggedOut.value, false);
	const next = request('/jobs');
	answer(refused);
	await assert.rejects(next, { status: 401 });
	assert.equal(loggedOut.value, true);
});
