import assert from 'node:assert/strict';
import { describe, it } from 'node:test';

import { wordChanges } from '../../static/lib/word_changes.js';

const BEFORE = '## Balls\n\nDraw tight boxes.\n\n- Say occluded.';

describe('wordChanges', () => {
	it('names the words that go and come, in order', () => {
		const changes = wordChanges(BEFORE, '## Balls\n\nDraw very tight boxes.\n\n- Say hidden.');
		assert.deepEqual(changes.filter(({ kind }) => kind !== 'same').map(({ kind, text }) => [kind, text.trim()]), [['new', 'very'], ['gone', 'occluded.'], ['new', 'hidden.']]);
	});
	it('gives both texts back', () => {
		for (const after of ['', BEFORE, 'other', `${BEFORE}\n\nMore  words `, 'Draw\nboxes. tight']) {
			const changes = wordChanges(BEFORE, after);
			assert.equal(changes.filter(({ kind }) => kind !== 'new').map(({ text }) => text).join(''), BEFORE);
			assert.equal(changes.filter(({ kind }) => kind !== 'gone').map(({ text }) => text).join(''), after);
		}
	});
	it('shows a text that is all new as replaced, however long', () => {
		const [a, b] = ['a', 'b'].map((word) => Array.from({ length: 5000 }, (_, i) => `${word}${i}`).join(' '));
		assert.deepEqual(wordChanges(a, b).map(({ kind }) => kind), ['gone', 'new']);
	});
});
