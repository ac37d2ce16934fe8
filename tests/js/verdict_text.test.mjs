import assert from 'node:assert/strict';
import { describe, it } from 'node:test';

import { counted, degrees, marginText, metres, pixelText, sharePercent } from '../../static/lib/format.js';
import { gateMargin } from '../../static/views/gate_names.js';
import { headline } from '../../static/views/verdict_text.js';

const policy = { tau_percent: 1 };
const ball = { box: [10, 10, 8, 8], point: null, out_of_view: false, occluded: false };

/** A group that passes with the first `used` of its views. */
function passing({ used = 3, p = 0.72, said = 'normal (p = 0.72)', error = 0.04, last = {}, solved = {} } = {}) {
	const keys = ['a', 'b', 'c'];
	const views = keys.map((key, i) => ({
		key, letter: key.toUpperCase(), width: 1280, height: 720, included: true, left_out: null, balls: [ball], lines: {}, ...(i === 2 ? last : {}),
	}));
	const solution = {
		passes: true, pairs: [], findings: [], ball: { views: keys.slice(0, used) },
		views: keys.map((key, i) => ({
			view: key, included: i < used, failed: null, ball: { error_px: error, error_percent: 0.01 }, calibration: { camera: {}, source: 'lines', jac: null, markings: [] },
			...(i === 2 ? solved : {}),
		})),
		gates: [{ name: 'chi_square', value: p, sentence: said, active: false, passed: true }],
	};
	return headline({ policy, views, verdict: {} }, solution, null);
}

describe('headline', () => {
	it('says that the views agree where their consistency is normal, and rounds their error as every other number', () => {
		const { tone, title, text } = passing();
		assert.deepEqual([tone, title, text], ['ok', 'All 3 views agree', 'Every view sees the ball in the same place, within 0.1 px.']);
		assert.match(passing({ error: 1.21 }).text, /within 1\.2 px/);
	});

	it('never says agree beside a consistency that is unlikely', () => {
		const said = { p: 0.012, said: 'unlikely (p = 0.012)' };
		const { tone, title, text } = passing(said);
		assert.deepEqual([tone, title, text], ['warn', 'All 3 views are used; their agreement is unlikely (p = 0.012)', 'The largest error of the ball is 0.1 px.']);
		assert.equal(passing({ ...said, used: 2 }).title, '2 of 3 views are used; their agreement is unlikely (p = 0.012)');
	});

	it('leads to the view and the line that it speaks of', () => {
		const markings = [{ marking: 'Side line left', used: true, outcome: 'fp', distances_px: [1, 127] }];
		const { text, remarks } = passing({
			last: { lines: { 'Side line left': [] } }, solved: { calibration: { camera: {}, source: 'lines', jac: null, markings } },
		});
		assert.equal(text, 'Every view sees the ball in the same place, within 0.1 px.');
		assert.deepEqual(remarks, [{ view: 'c', letter: 'C', marking: 'Side line left', text: 'does not fit; the group passes without it.' }]);
	});

	it('says that a camera is uncertain, and why, whatever else there is to say', () => {
		const solved = { calibration: { camera: {}, source: 'lines', jac: null, markings: [], unobservable: ['position'] } };
		const remarks = [{ view: 'c', letter: 'C', marking: null, text: 'has an uncertain camera: its lines do not determine the position.' }];
		assert.deepEqual(passing({ solved }).remarks, remarks);
		assert.deepEqual(passing({ used: 2, solved }).remarks, remarks);
		assert.deepEqual(passing({ used: 2, solved, last: { included: false } }).remarks, []);
	});

	it('says why a view is not used', () => {
		const why = (more) => passing({ used: 2, ...more }).text;
		assert.equal(why({ last: { balls: [{ ...ball, inferred: true }] } }), 'Not used: C (ball placed, not counted).');
		assert.equal(why({ solved: { failed: 'jac' } }), 'Not used: C (lines do not fit).');
		assert.equal(why({ solved: { ball: { error_px: 61 } } }), 'Not used: C (error 61.0 px, at most 14.7 px).');
		assert.equal(why({}), 'Not used: C (no matching view).');
	});
});

describe('numbers with their unit', () => {
	it('have one rounding each', () => {
		assert.deepEqual([44.46, null].map(degrees), ['44.5°', '–']);
		assert.deepEqual([-34.761, 0.067, undefined].map(metres), ['−34.76 m', '0.07 m', '–']);
		assert.deepEqual([7.26, 126.8, null].map(pixelText), ['7.3 px', '127 px', '–']);
		assert.deepEqual([999.5, 1719.8, -1040, 319_000].map(pixelText), ['1,000 px', '1,720 px', '−1,040 px', '>20,000 px']);
	});
});

describe('gateMargin', () => {
	const gate = (name, margin, passed = true) => gateMargin({ name, margin, passed, active: true });

	it('gives no margin to a gate that counts views', () => {
		assert.deepEqual(['calibratable', 'two_views', 'ball'].map((name) => gate(name, 0)), ['', '', '']);
		assert.equal(gate('two_views', -0.5, false), '');
		assert.equal(gate('baseline', 0), 'equals the threshold');
	});

	it('caps what nobody compares', () => {
		assert.equal(gate('baseline', 111.2), 'margin over 10×');
		assert.deepEqual([sharePercent(9.99), marginText(12), marginText(-12), marginText(0.33)], ['999 %', '>+10×', '<−10×', '+33 %']);
	});
});

describe('counted', () => {
	it('counts one thing as one', () => {
		const names = ['balls', 'pictures turned by EXIF', 'annotations without image', 'boxes', 'other classes', 'ball points', 'frames with persons only', 'images_missing'];
		assert.deepEqual(names.map((name) => counted(1, name)), [
			'1 ball', '1 picture turned by EXIF', '1 annotation without image', '1 box', '1 other class', '1 ball point', '1 frame with persons only', '1 image missing',
		]);
		assert.equal(counted(2, 'balls'), '2 balls');
	});
});
