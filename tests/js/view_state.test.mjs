import assert from 'node:assert/strict';
import { describe, it } from 'node:test';

import { picturesOf } from '../../static/overlays/scene.js';
import { gradeOfSize } from '../../static/geometry/residual.js';
import { whyNot } from '../../static/views/pair_table.js';
import { errorOf, gradeOfView, paintOf, uncertainViews, unusedErrors } from '../../static/views/view_state.js';

const box = { box: [10, 10, 8, 8], point: null, out_of_view: false, occluded: false };

function picture({ view = {}, solved = {}, apart = null, error = 3200 } = {}) {
	return {
		apart, tau: 14, ball: { error_px: error },
		view: { key: 'a', width: 1280, height: 720, included: true, left_out: null, balls: [box], ...view },
		solved: {
			view: 'a', included: true, failed: null, ball: { error_px: error }, ...solved,
			calibration: { camera: {}, source: 'given', jac: null, ...solved.calibration },
		},
	};
}

describe('paintOf', () => {
	const fit = { supported: 0.872, explained: 0.041, points: 90, error_px: 0.2, reason: null };
	const found = (paint) => paintOf(picture({ solved: { calibration: { camera: {}, paint } } }).solved);

	it('says both shares, and nothing where no paint was read', () => {
		assert.deepEqual(found(fit), { supported: '87 %', explained: '4.1 %', reason: '' });
		assert.equal(found(null), null);
		assert.equal(paintOf(null), null);
	});

	it('says what was read of the picture of a camera without lines, while the group is shown', () => {
		const given = picture().solved;
		assert.equal(paintOf(given), null);
		assert.deepEqual(paintOf(given, { ...fit, points: {} }), { supported: '87 %', explained: '4.1 %', reason: '' });
	});

	it('says why the camera is that of the clicks, and a dash where nothing was measured', () => {
		const unseen = { ...fit, supported: null, explained: null, reason: 'no_frame' };
		assert.deepEqual(found(unseen), { supported: '–', explained: '–', reason: 'no picture' });
	});
});

describe('uncertainViews', () => {
	const { view, solved } = picture({ solved: { calibration: { camera: {}, unobservable: ['position', 'focal length'] } } });

	it('are those whose camera their lines leave open, unless they are left out', () => {
		assert.deepEqual(uncertainViews({ views: [view] }, { views: [solved] }), [{ view, guess: 'position and focal length' }]);
		assert.deepEqual(uncertainViews({ views: [{ ...view, included: false }] }, { views: [solved] }), []);
		assert.deepEqual(uncertainViews({ views: [view] }, { views: [picture().solved] }), []);
	});
});

describe('errors of a view that is not used', () => {
	const unused = (more) => picture({ error: 223, solved: { included: false }, ...more });

	it('say what they are measured from, before and after the view is left out', () => {
		assert.equal(unusedErrors(unused({ apart: 31.8 })), '31.8 px in its best pair; 223 px from the 3D ball of the others');
		assert.equal(unusedErrors(unused({ apart: 9 })), '9.0 px in its best pair, which does not count; 223 px from the 3D ball of the others');
		assert.equal(unusedErrors(unused({ view: { included: false } })), '223 px from the 3D ball of the others');
		assert.equal(errorOf(unused({ apart: 31.8 })).from, 'pair');
		assert.equal(errorOf(unused()).from, 'others');
	});

	it('are none of a view that is used', () => {
		assert.equal(unusedErrors(picture({ error: 2 })), '');
		assert.equal(errorOf(picture({ error: 2 })).from, 'ball');
	});
});

describe('gradeOfView', () => {
	it('does not call a given camera well whose ball no other view confirms', () => {
		assert.equal(gradeOfView(picture({ solved: { included: false } })).grade, 'bad');
		assert.equal(gradeOfView(picture({ apart: 3200 })).grade, 'bad');
		assert.equal(gradeOfView(picture({ error: 2 })).grade, 'ok');
	});

	it('puts no red cross before a view whose own numbers are good', () => {
		const blameless = picture({ apart: 0.4, error: 0.4, solved: { included: false } });
		assert.deepEqual(gradeOfView(blameless), { grade: 'warn', sentence: 'no matching view' });
	});

	it('never calls a camera well that its lines do not determine', () => {
		const open = { calibration: { camera: {}, source: 'lines', unobservable: ['position'] } };
		assert.deepEqual(gradeOfView(picture({ error: 2, solved: open })), { grade: 'warn', sentence: 'uncertain' });
		assert.deepEqual(gradeOfView(picture({ error: 2, solved: open, view: { balls: [] } })), { grade: 'warn', sentence: 'uncertain' });
	});

	it('says that a ball was placed and does not count', () => {
		const placed = picture({ view: { balls: [{ ...box, inferred: true }] }, solved: { included: false } });
		assert.deepEqual(gradeOfView(placed), { grade: 'warn', sentence: 'ball placed, not counted' });
	});

	it('says that a view whose paint contradicts the camera is not counted', () => {
		const { grade, sentence } = gradeOfView(picture({ solved: { failed: 'agreement', included: false } }));
		assert.deepEqual([grade, sentence], ['bad', 'paint contradicts the camera']);
	});

	it('tells a view without a camera from one without a ball', () => {
		assert.equal(gradeOfView(picture({ solved: { calibration: { camera: null, source: 'lines', jac: null } } })).sentence, 'no camera');
		assert.equal(gradeOfView(picture({ view: { balls: [] } })).sentence, 'no ball');
	});
});

describe('errorOf', () => {
	it('is one error: in the best pair where the view agrees with no other, else to the 3D ball', () => {
		assert.equal(errorOf(picture({ apart: 27 })).px, 27);
		assert.equal(errorOf(picture()).px, 3200);
	});
});

describe('one number in every place', () => {
	const policy = { tau_percent: 1, jac_gamma_percent: 0.5, ball_diameter_m: 0.226 };
	const views = ['a', 'b', 'c'].map((key, i) => ({ key, letter: 'ABC'[i], width: 1280, height: 720, included: true, lines: {}, balls: [box] }));
	const group = { policy, views, verdict: { note: null } };
	const pair = (a, b, first, second) => ({ a, b, errors_px: [first, second], valid: false, failed: 'reprojection' });

	it('a view in no valid pair has its own error in its best pair, as the table of pairs has it', () => {
		const solution = { views: [], ball: null, pairs: [pair('a', 'b', 14.5, 27), pair('a', 'c', 90, 80), pair('b', 'c', 60.4, 59)] };
		assert.deepEqual(picturesOf(group, solution, null).map((picture) => errorOf(picture).px), [14.5, 27, 59]);
	});

	it('a pair whose errors are allowed is refused for what is wrong with it', () => {
		assert.equal(whyNot(group, pair('a', 'b', 9, 4)), 'the rays meet behind a camera');
		assert.equal(whyNot(group, pair('a', 'b', 9, 14.8)), 'reprojection');
		assert.equal(whyNot(group, { ...pair('a', 'b', 9, 4), failed: 'baseline' }), 'baseline');
	});

	it('a box that people draw around a ball is ordinary, and a red one is a finding', () => {
		assert.deepEqual([0.5, 0.6, 0.67, 1, 1.43, 1.5].map(gradeOfSize), ['warn', 'warn', 'ok', 'ok', 'ok', 'ok']);
		assert.deepEqual([1.51, 2, 2.01, 0.49, null].map(gradeOfSize), ['warn', 'warn', 'bad', 'bad', 'unseen']);
	});
});
