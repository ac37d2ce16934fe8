import assert from 'node:assert/strict';
import { describe, it } from 'node:test';

import {
	applyEdit, describe as describe_, editOf, markNotVisible, movePoint, previewBody, requestOf, sameTarget, swapSides,
} from '../../static/state/edits.js';
import { leftOutText } from '../../static/state/reasons.js';

const view = {
	id: 31, key: '7.png', letter: 'A', label: 'Main camera', width: 1280, height: 720, included: true,
	station: { id: 3, key: 'x', shared: false, etag: '"s"' }, image: null,
	lines: { 'Middle line': [{ x: 1, y: 2 }, { x: 3, y: 4 }], 'Goal left post left': [{ x: 5, y: 6 }] },
	balls: [{ box: [10, 10, 4, 4], point: null, occluded: false, out_of_view: false }],
};
const group = { id: 12, etag: '"g"', views: [view] };

describe('movePoint', () => {
	it('changes one point and no other value', () => {
		const edit = movePoint(view, 'Middle line', 1, { x: 9, y: 9 });
		const next = applyEdit(group, edit);
		assert.deepEqual(next.views[0].lines['Middle line'], [{ x: 1, y: 2 }, { x: 9, y: 9 }]);
		assert.deepEqual(view.lines['Middle line'][1], { x: 3, y: 4 });
	});

	it('takes the marking away with its last point', () => {
		const edit = movePoint(view, 'Goal left post left', 0, null);
		assert.deepEqual(edit.lines, { 'Goal left post left': null });
		assert.ok(!('Goal left post left' in applyEdit(group, edit).views[0].lines));
	});
});

describe('a marking that is not visible', () => {
	const name = 'Goal left post left';
	const hidden = markNotVisible(view, name, true);
	const marked = applyEdit(group, hidden).views[0];

	it('is said without points, is kept while others change, and is taken back', () => {
		assert.deepEqual([marked.not_visible, name in marked.lines], [[name], false]);
		assert.deepEqual(requestOf(group, hidden).body, { lines: { [name]: null }, not_visible: [name] });
		assert.deepEqual(editOf({ edit: 'set_lines', view: '7.png', lines: { [name]: null }, source: { [name]: 'not_visible' } }), hidden);
		assert.equal(describe_(group, hidden), 'Goal left post left of A marked as not visible');
		const shown = { ...group, views: [marked] };
		assert.deepEqual(applyEdit(shown, movePoint(marked, 'Middle line', 0, null)).views[0].not_visible, [name]);
		assert.deepEqual(applyEdit(shown, markNotVisible(marked, name, false)).views[0].not_visible, []);
	});

	it('is the other end of the pitch once the sides are swapped', () => {
		const swapped = applyEdit({ ...group, views: [marked] }, swapSides(marked)).views[0];
		assert.deepEqual(swapped.not_visible, ['Goal right post left']);
		assert.deepEqual(Object.keys(swapped.lines), ['Middle line']);
	});
});

describe('requestOf', () => {
	it('sends lines of a broadcast view to the view, with the ETag of the group', () => {
		const { path, etag } = requestOf(group, movePoint(view, 'Middle line', 0, { x: 0, y: 0 }));
		assert.deepEqual([path, etag], ['/views/31/lines', '"g"']);
	});

	it('sends lines of a static camera to its station, with the station\'s ETag', () => {
		const fixed = { ...group, views: [{ ...view, station: { ...view.station, shared: true } }] };
		const { path, etag } = requestOf(fixed, movePoint(view, 'Middle line', 0, { x: 0, y: 0 }));
		assert.deepEqual([path, etag], ['/stations/3/lines?group=12', '"s"']);
	});

	it('sends null for a ball that is taken away', () => {
		assert.equal(requestOf(group, { kind: 'ball', view: '7.png', ball: null }).body, null);
	});

	it('sends a box without a point', () => {
		const { body } = requestOf(group, { kind: 'ball', view: '7.png', ball: view.balls[0] });
		assert.deepEqual(body, { box: [10, 10, 4, 4], occluded: false, out_of_view: false });
	});
});

describe('an edit that leaves a view out', () => {
	const edit = { kind: 'include', view: '7.png', included: false, reason: 'not_same_instant', note: 'a moment later' };

	it('sends its reason, which is no part of what is computed', () => {
		const { reason, note } = edit;
		assert.deepEqual(requestOf(group, edit).body, { included: false, reason, note });
		assert.deepEqual(requestOf(group, { ...edit, included: true }).body, { included: true });
		assert.deepEqual(previewBody(edit), { views: { '7.png': { included: false } } });
	});

	it('shows why, until the view is taken in again', () => {
		const left = applyEdit(group, edit);
		assert.equal(leftOutText(left.views[0].left_out), 'left out: not the same instant (a moment later)');
		assert.equal(describe_(group, edit), 'View A left out: not the same instant (a moment later)');
		assert.equal(applyEdit(left, { ...edit, included: true }).views[0].left_out, null);
		assert.equal(leftOutText(applyEdit(group, { ...edit, reason: undefined }).views[0].left_out), 'left out');
		assert.equal(leftOutText({ reason: 'other', note: 'blurred' }), 'left out: blurred');
	});
});

describe('previewBody', () => {
	it('names the view by its key', () => {
		const edit = { kind: 'include', view: '7.png', included: false };
		assert.deepEqual(previewBody(edit), { views: { '7.png': { included: false } } });
	});
});

describe('editOf', () => {
	it('draws and deletes the markings that the server names', () => {
		const lines = { 'Middle line': null, 'Side line top': [[1, 2], [3, 4]], 'Goal left post left': [] };
		const next = applyEdit(group, editOf({ edit: 'set_lines', view: '7.png', lines }));
		assert.deepEqual(next.views[0].lines, { 'Side line top': [{ x: 1, y: 2 }, { x: 3, y: 4 }] });
	});

	it('keeps the one ball of several', () => {
		const kept = { box: [1, 1, 2, 2], point: null, occluded: false, out_of_view: false };
		const two = { ...group, views: [{ ...view, balls: [view.balls[0], kept] }] };
		const edit = editOf({ edit: 'set_balls', view: '7.png', balls: [kept] });
		assert.deepEqual(applyEdit(two, edit).views[0].balls, [kept]);
		assert.equal(editOf({ edit: 'set_balls', view: '7.png', balls: [] }).ball, null);
	});

	it('leaves a view out and takes it in again', () => {
		for (const included of [false, true]) {
			const edit = editOf({ edit: 'include_view', view: '7.png', included });
			assert.deepEqual(requestOf(group, edit).body, { included });
		}
	});

	it('takes a picture as stretched or cropped, and as it is again', () => {
		const picture = { aspect: 1, shift: [0, 0], sigma: [0.3, 0.4, 0.4] };
		for (const said of [picture, null]) {
			const edit = editOf({ edit: 'set_picture', view: '7.png', picture: said });
			const { path, body } = requestOf(group, edit);
			assert.deepEqual([path, body], ['/views/31', { picture: said }]);
			assert.deepEqual(applyEdit(group, edit).views[0].station.picture, said);
			assert.deepEqual(previewBody(edit), { views: { '7.png': { picture: said } } });
		}
		assert.equal(describe_(group, editOf({ edit: 'set_picture', view: '7.png', picture })), 'Picture of A treated as stretched or cropped');
	});
});

describe('sameTarget', () => {
	it('tells two objects of one view apart', () => {
		const line = movePoint(view, 'Middle line', 0, { x: 0, y: 0 });
		assert.ok(sameTarget(line, movePoint(view, 'Middle line', 1, { x: 0, y: 0 })));
		assert.ok(!sameTarget(line, { kind: 'ball', view: '7.png', ball: null }));
	});
});
