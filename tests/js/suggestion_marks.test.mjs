import assert from 'node:assert/strict';
import { describe, it } from 'node:test';

// A page without a style sheet, on a screen whose pixels are CSS pixels.
globalThis.document = { documentElement: 'root' };
globalThis.getComputedStyle = () => ({ getPropertyValue: (name) => name });
globalThis.matchMedia = () => ({ addEventListener: () => {} });
globalThis.devicePixelRatio = 1;

const { drawSuggestionMarks } = await import('../../static/overlays/suggestion_marks.js');

const AT = { x: 40, y: 60 };
const LINES = { 'Big rect. left main': [AT, { x: 80, y: 60 }] };
/** Centres of pixels lie at halves. */
const viewport = { scale: 1, left: -0.5, top: -0.5 };
const fit = { marking: 'Big rect. left main', points: [{ point: AT, nearest: { x: 40, y: 66 } }] };

/** What is written, and where rings and lines go. @param {object} meant @param {number} width of the panel */
function drawn(meant, width = 900) {
	const seen = { words: [], rings: [], ends: [] };
	const own = {
		canvas: { width, height: 500 },
		measureText: () => ({ width: 50 }),
		fillText: (text) => seen.words.push(text),
		arc: (x, y) => seen.rings.push([x, y]),
		lineTo: (x, y) => seen.ends.push([x, y]),
	};
	const context = new Proxy(own, { get: (target, name) => target[name] ?? (() => {}), set: () => true });
	drawSuggestionMarks(context, { picture: { view: { lines: LINES }, markings: [fit] }, viewport, meant });
	return { words: seen.words, rings: seen.rings.length / 2, ends: seen.ends };
}

describe('drawSuggestionMarks', () => {
	it('points at a line, at one of its points, at a place, or speaks of the whole view', () => {
		const marking = 'Big rect. left main';
		assert.deepEqual(drawn({ marking, index: null, caption: 'is it?' }), { words: ['is it?'], rings: 0, ends: [[80, 60]] });
		assert.deepEqual(drawn({ marking, index: 0, caption: 'this one' }), { words: ['this one'], rings: 1, ends: [[40, 66]] });
		assert.deepEqual(drawn({ marking, index: 0, point: [45, 70], caption: 'there' }).ends, [[45, 70]]);
		assert.deepEqual(drawn({ guide: { looks: [10, 20] }, caption: 'here?' }), { words: ['here?'], rings: 1, ends: [] });
		assert.deepEqual(drawn({ marking: null, caption: 'all of it?' }), { words: ['all of it?'], rings: 0, ends: [] });
	});

	it('shortens the markings of a caption, and leaves it out of narrow panels', () => {
		const meant = { marking: 'Big rect. left main', caption: 'Big rect. left main → Small rect. left main' };
		assert.deepEqual(drawn(meant).words, ['Big rect. left main → Small rect. left main']);
		assert.deepEqual(drawn(meant, 200).words, []);
	});

	it('points at nothing that has no words', () => {
		assert.deepEqual(drawn({ marking: 'Big rect. left main', caption: '' }), { words: [], rings: 0, ends: [] });
		assert.deepEqual(drawn(null), { words: [], rings: 0, ends: [] });
	});
});
