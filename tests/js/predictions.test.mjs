import assert from 'node:assert/strict';
import { describe, it } from 'node:test';

import { markAt, placeMarks } from '../../static/overlays/prediction_places.js';
import { conflictOf } from '../../static/state/conflict.js';
import { applyEdit, describe as inWords, requestOf } from '../../static/state/edits.js';
import { acceptEdit, acceptEdits, distanceTo, marksOf, EVERY_SET, setNames, setToShow, surest } from '../../static/state/prediction_marks.js';
import { objectsOf, sameObject } from '../../static/state/tab_order.js';
import { hitTest } from '../../static/tools/hit.js';

const station = { id: 1, shared: false };
const views = [
	{ id: 11, key: '7.png', letter: 'A', width: 1280, height: 720, included: true, lines: {}, balls: [], station },
	{ id: 12, key: '7_1.png', letter: 'B', width: 1280, height: 720, included: true, lines: {}, station, balls: [
		{ box: [200, 100, 10, 10], point: null, occluded: false, out_of_view: false },
	] },
];
const group = { id: 5, etag: '"e"', views, verdict: {} };
const box = (id, view, name, score, x = 100) => ({ id, view, name, predictions: name === 'new' ? 2 : 1, score, scored: true, box: [x, 100, 14, 14] });
const found = {
	sets: 2, accepted: [],
	items: [box(1, 11, 'new', 0.9), box(2, 11, 'new', 0.4, 300), box(3, 11, 'old', 0.95, 110), box(4, 12, 'new', 0.7, 198)],
};
const all = { set: '', least: 0.25 };

describe('marksOf', () => {
	it('calls the surest of each set sure, where it is sure enough', () => {
		const { marks } = marksOf(found, group, all).get('7.png');
		assert.deepEqual(marks.map(({ id, sure }) => [id, sure]), [[1, true], [2, false], [3, true]]);
		const strict = marksOf(found, group, { set: '', least: 0.92 }).get('7.png').marks;
		assert.deepEqual(strict.filter(({ sure }) => sure).map(({ id }) => id), [3]);
	});

	it('calls nothing sure that came without scores', () => {
		const careful = { ...found, items: [{ ...box(9, 11, 'careful', 1), scored: false }] };
		const { marks } = marksOf(careful, group, all).get('7.png');
		assert.deepEqual([marks.map(({ sure }) => sure), surest(marks)], [[false], null]);
	});

	it('shows one set when that is asked for', () => {
		assert.deepEqual(marksOf(found, group, { ...all, set: 'old' }).get('7.png').marks.map(({ id }) => id), [3]);
	});

	it('draws five of a set at most, and counts the others', () => {
		const many = { ...found, items: Array.from({ length: 8 }, (_, i) => box(i, 11, 'new', 0.9 - i / 10)) };
		const { marks, fewer } = marksOf(many, group, all).get('7.png');
		assert.deepEqual([marks.length, fewer], [5, 3]);
	});

	it('takes the mark away that became the ball, and says where that is from', () => {
		const [mark] = marksOf(found, group, all).get('7.png').marks;
		const after = applyEdit(group, acceptEdit(views[0], mark, false));
		const own = marksOf(found, after, all).get('7.png');
		assert.deepEqual(own.marks.map(({ id }) => id), [2, 3]);
		assert.equal(own.origin, 'predicted by new, score 0.90');
		const said = { ...found, accepted: [{ view: 11, name: 'new', score: 0.9, by: 'ana', at: null }] };
		assert.equal(marksOf(said, after, all).get('7.png').origin, 'predicted by new, score 0.90, accepted by ana');
		const followed = { ...group, views: group.views.map((view) => (view.key === '7.png' ? { ...view, balls: [{ ...after.views[0].balls[0], predicted_by: 'followed from 106' }] } : view)) };
		assert.equal(marksOf(found, followed, all).get('7.png').origin, 'followed from 106');
	});

	it('says nothing of a ball that a person drew', () => {
		assert.equal(marksOf(found, group, all).get('7_1.png').origin, null);
	});
});

describe('setToShow', () => {
	const careful = { ...found, items: [{ ...box(9, 11, 'careful', 1), scored: false }, ...found.items] };

	it('is the newest that has scores until one is chosen', () => {
		assert.deepEqual([setToShow(found, ''), setToShow(careful, ''), setToShow(careful, 'gone')], ['new', 'new', 'new']);
		assert.deepEqual([setToShow(careful, 'careful'), setToShow(careful, EVERY_SET)], ['careful', '']);
	});
});

describe('accepting', () => {
	const shown = marksOf(found, group, all);
	const { marks } = shown.get('7.png');

	it('takes the surest of all sets', () => {
		assert.equal(surest(marks).id, 3);
		assert.equal(surest(marks.filter(({ sure }) => !sure)), null);
	});

	it('is an edit that names the prediction', () => {
		const edit = acceptEdit(views[0], marks[0], false);
		assert.deepEqual(requestOf(group, edit), {
			path: '/views/11/predictions/1/accept?replace=false', body: undefined, etag: '"e"', method: 'POST',
		});
		assert.equal(inWords(group, edit), 'Ball of A accepted from new');
		assert.deepEqual(applyEdit(group, edit).views[0].balls[0].box, [100, 100, 14, 14]);
	});

	it('of all views leaves those alone that have a ball', () => {
		assert.deepEqual(acceptEdits(group, shown).map(({ view, prediction }) => [view, prediction.id]), [['7.png', 3]]);
	});

	it('insists when a person keeps it against what somebody else did', () => {
		const edit = acceptEdit(views[0], marks[0], false);
		const base = { lines: {}, balls: [], included: true, verdict: {} };
		const [field] = conflictOf(group, [{ id: 'x', group: 5, edit, verdict: null, base }]).fields;
		assert.deepEqual(field.edit.prediction, { id: 1, replace: true });
	});

	it('knows how far it would move a ball', () => {
		assert.equal(distanceTo(views[0], marks[0]), null);
		assert.equal(distanceTo(views[1], shown.get('7_1.png').marks[0]), 2);
	});

	it('knows the sets, the newest first', () => {
		assert.deepEqual(setNames(found), ['new', 'old']);
	});
});

describe('placeMarks', () => {
	const viewport = { scale: 2, left: 0, top: 0 };
	const { marks } = marksOf(found, group, all).get('7.png');

	it('puts brackets around the box, and no tag on another', () => {
		const [first, , third] = placeMarks(marks, viewport, 1280);
		assert.deepEqual([first.box.width, first.box.height], [38, 38]);
		const below = first.tag.top + first.tag.height;
		assert.ok(third.tag.top >= below || third.tag.left >= first.tag.left + first.tag.width);
	});

	it('keeps tags within the image, and long names short', () => {
		const edge = [{ id: 1, name: 'a detector with a very long name', score: 0.5, scored: true, box: [1270, 700, 8, 8], sure: true }];
		const [{ tag, text }] = placeMarks(edge, viewport, 1280);
		assert.ok(tag.left + tag.width <= 2 * 1280);
		assert.equal(text, 'a detector with a… 0.50');
	});

	it('names the set of what is less sure only while it is selected', () => {
		assert.equal(placeMarks(marks, viewport, 1280)[1].text, '0.40');
		assert.equal(placeMarks(marks, viewport, 1280, 2)[1].text, 'new 0.40');
	});

	it('is what the pointer goes by: tags first, then the nearest box', () => {
		const placed = placeMarks(marks, viewport, 1280);
		assert.equal(markAt(placed, { x: placed[2].tag.left + 3, y: placed[2].tag.top + 3 }).id, 3);
		assert.equal(markAt(placed, { x: 2 * 101, y: 2 * 107 }).id, 1);
		assert.equal(markAt(placed, { x: 900, y: 900 }), null);
	});
});

describe('hitTest', () => {
	const viewport = { scale: 1, left: 0, top: 0 };
	const anywhere = () => ({ id: 4 });

	it('finds a prediction where nobody said anything', () => {
		assert.deepEqual(hitTest(views[0], viewport, { x: 50, y: 50 }, null, anywhere), { kind: 'prediction', prediction: 4 });
		assert.equal(hitTest(views[0], viewport, { x: 50, y: 50 }, null), null);
	});

	it('prefers the ball that a person drew', () => {
		assert.deepEqual(hitTest(views[1], viewport, { x: 205, y: 105 }, null, anywhere), { kind: 'ball' });
	});
});

describe('objectsOf', () => {
	it('lists the ball, what was predicted, then the points', () => {
		const view = { ...views[1], lines: { 'Middle line': [{ x: 1, y: 1 }] } };
		assert.deepEqual(objectsOf(view, [{ id: 4 }]).map(({ kind }) => kind), ['ball', 'prediction', 'point']);
	});

	it('tells predictions apart', () => {
		const one = { kind: 'prediction', view: '7.png', prediction: 1 };
		assert.ok(sameObject(one, { ...one }));
		assert.ok(!sameObject(one, { ...one, prediction: 2 }));
		assert.ok(!sameObject(one, { kind: 'ball', view: '7.png' }));
	});
});
