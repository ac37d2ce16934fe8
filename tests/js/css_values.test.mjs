import assert from 'node:assert/strict';
import { describe, it } from 'node:test';

import { followed, tokens } from '../../static/lib/css_values.js';
import { colourOf, readPalette } from '../../static/views/scene3d/scene_colours.js';

/** What is listened to. */
const queries = [];
// A page whose style sheet gives every property its own name as a value.
globalThis.document = { documentElement: 'root' };
globalThis.getComputedStyle = (element) => ({ getPropertyValue: (name) => ` ${element} ${name} ` });
globalThis.matchMedia = (query) => ({ addEventListener: (kind, hear) => queries.push({ query, kind, hear }) });

describe('css values', () => {
	it('are read by their names behind what they share, without blanks around them', () => {
		assert.deepEqual(tokens(['ink', 'bad'], 'canvas-'), { ink: 'root --canvas-ink', bad: 'root --canvas-bad' });
		assert.deepEqual(tokens(['line']), { line: 'root --line' });
	});
});

describe('followed', () => {
	it('is read again when the scheme or the contrast changes', () => {
		let reads = 0;
		const value = followed(() => { reads += 1; return reads; });
		assert.equal(value.value, 1);
		const asked = queries.splice(0);
		assert.deepEqual(asked.map(({ query }) => query), ['(prefers-color-scheme: dark)', '(prefers-contrast: more)']);
		for (const { kind, hear } of asked) if (kind === 'change') hear();
		assert.equal(value.value, 3);
	});
});

describe('colourOf', () => {
	it('is the colour of the view of a letter, and of the first for a letter without one', () => {
		const palette = readPalette();
		assert.equal(palette.ball, 'root --scene-ball');
		assert.equal(colourOf(palette, 'C'), 'root --scene-view-c');
		assert.equal(colourOf(palette, 'Q'), 'root --scene-view-a');
	});
});
