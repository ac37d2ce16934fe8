import assert from 'node:assert/strict';
import { readFileSync } from 'node:fs';
import { describe, it } from 'node:test';

import { complete } from '../../static/state/completion.js';
import { optionValue } from '../../static/state/import_formats.js';

/** As `/api/v1/query-fields` says. */
const fields = JSON.parse(readFileSync(new URL('golden.json', import.meta.url), 'utf8')).query_fields;
const labels = (text, facets = {}) => complete(text, text.length, facets, fields).offers.map(({ label }) => label);

describe('complete', () => {
	it('offers the fields that begin with what is typed, with their operators', () => {
		assert.deepEqual(labels('stat'), ['status:']);
		assert.deepEqual(labels('sig'), ['sigma<', 'sigma>']);
	});

	it('offers the values of a field, those that begin with the text first', () => {
		assert.deepEqual(labels('status:'), ['unreviewed', 'accepted', 'rejected', 'deferred']);
		assert.deepEqual(labels('status:re').slice(0, 1), ['rejected']);
	});

	it('replaces the last word alone, and keeps a minus and chosen values', () => {
		const { from, to, offers } = complete('jac<0.5 -status:accepted,rej', 28, {}, fields);
		assert.deepEqual([from, to, offers[0].text], [8, 28, '-status:accepted,rejected ']);
	});

	it('completes in the middle of the text', () => {
		const { from, to, offers } = complete('stat jac<0.5', 4, {}, fields);
		assert.deepEqual([from, to, offers[0].text], [0, 4, 'status:']);
	});

	it('quotes values with spaces, and knows those of the dataset', () => {
		const { offers } = complete('match:"ea', 9, { match: ['Eastmere - Skarvik'] }, fields);
		assert.deepEqual(offers.map(({ text }) => text), ['match:"Eastmere - Skarvik" ']);
	});

	it('knows that groups can be named', () => {
		assert.deepEqual(labels('i'), ['id:']);
		assert.deepEqual(labels('id:12,'), []);
	});

	it('knows fields by their other names, and says in what a number is counted', () => {
		assert.deepEqual(labels('first_failing:ja'), ['jac']);
		assert.match(complete('sig', 3, {}, fields).offers[0].hint, /, m$/);
		assert.deepEqual(labels('-sort'), []);
	});

	it('offers nothing before it knows the fields', () => {
		assert.deepEqual(complete('stat', 4, {}, []).offers, []);
	});

	it('offers no value for a number', () => {
		assert.deepEqual(labels('jac<0.'), []);
	});
});

describe('optionValue', () => {
	const read = (kind, text) => optionValue({ kind }, text);

	it('reads sizes, cameras and offsets', () => {
		assert.deepEqual(read('size', '960 x 540'), [960, 540]);
		assert.deepEqual(read('cameras', '2, 6'), [2, 6]);
		assert.equal(read('offset', '8'), 8);
		assert.deepEqual(read('offset', '1:8,2:-9'), { 1: 8, 2: -9 });
	});

	it('says nothing where nothing is typed, and leaves the rest to the server', () => {
		assert.equal(read('size', ' '), undefined);
		assert.equal(read('size', 'wide'), 'wide');
		assert.deepEqual(read('cameras', '2,x'), [2, 'x']);
	});
});
