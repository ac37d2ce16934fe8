// @ts-check
import assert from 'node:assert/strict';
import { describe, it } from 'node:test';

import { jobToShow } from '../../static/state/jobs.js';

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
