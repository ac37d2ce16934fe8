import assert from 'node:assert/strict';
import { readFileSync } from 'node:fs';
import { describe, it } from 'node:test';

import { blocksOf, spansOf } from '../../static/lib/markdown.js';

describe('blocksOf', () => {
	it('tells headings, paragraphs, lists and tables apart, and leaves pictures out', () => {
		const text = '# Title\n\nOne\ntwo.\n\n- a\n  b\n- c\n\n| x | y |\n|---|---|\n| 1 | 2 |\n\n![words](p.jpg)';
		assert.deepEqual(blocksOf(text), [
			{ kind: 'heading', level: 1, text: 'Title' },
			{ kind: 'paragraph', text: 'One two.' },
			{ kind: 'list', items: ['a b', 'c'] },
			{ kind: 'table', rows: [['x', 'y'], ['1', '2']] },
		]);
	});

	it('reads a paragraph that stands right below its heading', () => {
		assert.deepEqual(blocksOf('## Next\nHello.').map(({ kind }) => kind), ['heading', 'paragraph']);
	});

	it('leaves no mark of Markdown in the guide', () => {
		const { text } = JSON.parse(readFileSync(new URL('../../static/help/guide.json', import.meta.url), 'utf8'));
		const blocks = blocksOf(text);
		assert.ok(blocks.length > 10);
		const words = blocks.flatMap((block) => (block.kind === 'list' ? block.items : block.kind === 'table' ? block.rows.flat() : [block.text]));
		for (const { text: shown } of words.flatMap((line) => spansOf(line))) assert.doesNotMatch(shown, /[`|]|\*\*|\]\(/);
	});
});

describe('spansOf', () => {
	it('finds keys, strong and emphasised words, and the words of links', () => {
		assert.deepEqual(spansOf('Press `A`, **then** *go* [on](x.md).').map(({ kind, text }) => `${kind}:${text}`), [
			'text:Press ', 'key:A', 'text:, ', 'strong:then', 'text: ', 'em:go', 'text: ', 'text:on', 'text:.',
		]);
	});
});
