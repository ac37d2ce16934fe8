// @ts-check
import assert from 'node:assert/strict';
import { describe, it } from 'node:test';

import { ApiError } from '../../static/api/problem.js';
import { follow, jobToShow, waitingText } from '../../static/state/jobs.js';

// A page that nobody looks at is told nothing: it asks.
globalThis.document = /** @type {any} */ ({ hidden: true, addEventListener() {}, removeEventListener() {} });

/** @param {number} id @param {string} state */
const job = (id, state) => /** @type {any} */ ({ id, state });

describe('jobToShow', () => {
	it('shows the one at work before one that waits or has ended', () => {
		assert.equal(jobToShow([job(1, 'done'), job(2, 'running'), job(3, 'waiting')])?.id, 2);
	});
	it('shows the one that begins next where none is at work', () => {
		assert.equal(jobToShow([job(1, 'failed'), job(2, 'waiting'), job(3, 'waiting')])?.id, 2);
	});
	it('shows the last that ended where all are over', () => {
		assert.equal(jobToShow([job(1, 'done'), job(2, 'cancelled')])?.id, 2);
	});
	it('shows nothing where there is none', () => {
		assert.equal(jobToShow([]), null);
	});
});

describe('waitingText', () => {
	const [index, solve, other] = [
		{ ...job(3, 'running'), title: 'Index clip_0', dataset: 'a' }, { ...job(4, 'running'), title: 'Solve b', dataset: 'b' }, { ...job(5, 'waiting'), title: 'Export a', dataset: 'a' },
	];
	it('names the job that runs before, of the same dataset where there is one', () => {
		assert.equal(waitingText({ ...job(6, 'waiting'), dataset: 'b' }, [index, solve, other]), 'Waiting for: Solve b (3 jobs before it)');
		assert.equal(waitingText({ ...job(6, 'waiting'), dataset: null }, [index]), 'Waiting for: Index clip_0 (1 job before it)');
	});
	it('names none that begins later, or that the person may not see', () => {
		assert.equal(waitingText({ ...job(2, 'waiting'), dataset: 'a' }, [index, solve]), 'Waiting.');
		assert.equal(waitingText({ ...job(6, 'waiting'), dataset: 'a' }, []), 'Waiting.');
	});
});

describe('follow', () => {
	/** What the server answers, one after the other. @param {[number, any][]} answers */
	function answering(answers) {
		globalThis.fetch = /** @type {any} */ (async () => {
			const [status, json] = /** @type {[number, any]} */ (answers.shift());
			return { ok: status < 400, status, headers: new Headers(), json: async () => json };
		});
	}

	/** Let so many pauses pass. @param {import('node:test').TestContext} t @param {number} pauses */
	async function pass(t, pauses) {
		for (let i = 0; i < pauses; i += 1) {
			t.mock.timers.tick(5000);
			await new Promise((resolve) => { setImmediate(resolve); });
		}
	}

	it('goes on where the server is busy, away behind its proxy, or asks to log in again', async (t) => {
		t.mock.timers.enable({ apis: ['setTimeout'] });
		answering([[503, {}], [502, null], [401, {}], [200, job(4, 'done')]]);
		const ending = follow(job(4, 'running'), () => {});
		await pass(t, 4);
		assert.equal((await ending).state, 'done');
	});

	it('ends where the job is gone', async (t) => {
		t.mock.timers.enable({ apis: ['setTimeout'] });
		answering([[404, { detail: 'gone' }]]);
		const ending = follow(job(4, 'running'), () => {});
		const refused = assert.rejects(ending, ApiError);
		await pass(t, 1);
		await refused;
	});
});
