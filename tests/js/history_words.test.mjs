import assert from 'node:assert/strict';
import { describe, it } from 'node:test';

import { sentenceOfEntry } from '../../static/state/history_words.js';

const said = (kind, body) => sentenceOfEntry({ id: 1, at: '', actor: 'anna', kind, body }, () => 'B');

describe('sentenceOfEntry', () => {
	it('names lines that were drawn and removed', () => {
		const edit = { edit: 'set_lines', view: 'x', lines: { 'Middle line': [[1, 2]], 'Circle left': null } };
		assert.equal(said('edit', { edit }), 'Drew “Middle line” and removed “Circle left” in B');
		assert.equal(said('undo', { edit }), 'Undid: drew “Middle line” and removed “Circle left” in B');
	});
	it('names each of several edits that are one', () => {
		const edits = [{ edit: 'set_balls', view: 'x', balls: [] }, { edit: 'set_lines', view: 'x', lines: { 'Circle left': null } }];
		const edit = { edit: 'several', edits };
		assert.equal(said('edit', { edit }), 'Removed the ball in B; removed “Circle left” in B');
		assert.equal(said('undo', { edit }), 'Undid: removed the ball in B; removed “Circle left” in B');
	});
	it('says where a ball was followed from', () => {
		const ball = (source) => ({ edit: { edit: 'set_balls', view: 'x', balls: [{ predicted_by: source }] } });
		assert.equal(said('edit', ball('followed from 106')), 'Accepted the ball followed from 106 in B');
		assert.equal(said('edit', ball('')), 'Placed the ball in B');
	});
	it('says what was decided, and why', () => {
		assert.equal(said('verdict', { state: 'rejected', reason: 'bad_field_lines', note: 'no', override: null }), 'Rejected because of bad field lines: “no”');
	});
	it('says whose independent annotation was taken over, and how that was decided', () => {
		assert.equal(said('take', { did: 'adopted', take: 1, person: 'anna' }), 'Applied anna’s independent annotation');
		assert.equal(said('agreement', { did: 'agreed', person: 'anna', of: ['anna', 'bo'] }), 'anna and bo agree: anna’s annotation is used');
		assert.equal(said('work', { did: 'handed back', person: 'bo', reason: 'the far line' }), 'Returned to bo: “the far line”');
		assert.equal(said('agreement', { did: 'reopened', person: 'bo' }), 'The decision for bo’s annotation was undone: the group waits for a decision again');
		assert.equal(said('agreement', { did: 'decided', person: 'bo', of: ['anna', 'bo'] }), 'Chose bo’s annotation');
	});
	it('says nothing of the words of a comment', () => {
		assert.equal(said('comment', { did: 'resolved', thread: 3 }), 'Resolved a thread');
		assert.equal(said('import', null), 'Imported');
	});
});
