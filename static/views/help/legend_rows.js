// @ts-check
/** Every mark that the product draws: what it is called, what it means, and how it is drawn. */

import { html } from 'htm/preact';

import { colours } from '../../lib/colours.js';
import { drawBall } from '../../overlays/ball.js';
import { drawEpipolars } from '../../overlays/epipolars.js';
import { drawExpected } from '../../overlays/expected_ball.js';
import { drawGhosts } from '../../overlays/ghosts.js';
import { drawStrip } from '../../overlays/line_strip.js';
import { drawMarkings } from '../../overlays/markings.js';
import { drawSuggestionMarks } from '../../overlays/suggestion_marks.js';
import { drawPins } from '../../overlays/pins.js';
import { drawPixelGrid } from '../../overlays/pixel_grid.js';
import { drawPoints, drawSelectedPoint, drawResidualLines } from '../../overlays/points.js';
import { drawPredictions } from '../../overlays/predictions.js';
import { proposalDrawing } from '../../overlays/proposal.js';
import { drawUndrawn } from '../../overlays/undrawn.js';
import { drawCurve } from '../timeline/drawing.js';
import { ballAt, circle, drawGrass, gradeAt, HEIGHT, KEY, lineOf, sceneOf, WIDTH } from './legend_scene.js';

/** @import {ComponentChildren} from 'preact' */
/** @import {TimelineJson} from '../../api/timeline.js' */
/** @import {Field} from '../../state/conflict.js' */
/** @import {Draw, Scene} from '../../overlays/scene.js' */

/**
 * @typedef {object} Row
 * @property {string} name
 * @property {string} meaning
 * @property {string} tokens names of the colours in tokens.css, with spaces between
 * @property {(context: CanvasRenderingContext2D) => void} [draw] on a canvas
 * @property {ComponentChildren} [part] or as a part of the page
 */
/** @typedef {{title: string, rows: Row[]}} Section */

/** @param {Scene} scene @param {...Draw} draws @returns {(context: CanvasRenderingContext2D) => void} */
function onGrass(scene, ...draws) {
	return (context) => {
		drawGrass(context);
		for (const draw of draws) draw(context, scene);
	};
}

const LETTERS = ['A', 'B', 'C', 'D', 'E', 'F'];
const FIT = { reprojected: [66, 26], optimized_diameter_px: 24, optimized_box: [54, 14, 24, 24] };
const fit = /** @type {any} */ (FIT);
const expecting = /** @type {any} */ ({ expected: { place: [66, 26], covariance: [36, 4, 4, 16], box: [57, 17, 18, 18] } });
const solid = { selected: /** @type {const} */ ({ kind: 'point', view: KEY, marking: 'Side', index: 0 }) };
/** @param {boolean} sure */
const mark = (sure) => ({ id: sure ? 1 : 2, name: 'detector', score: sure ? 0.93 : 0.31, scored: true, sure, box: /** @type {[number, number, number, number]} */ ([18, 14, 24, 24]) });
/** @param {boolean} sure */
const predicted = (sure) => sceneOf({ predictions: /** @type {any} */ ({ marks: [mark(sure)], fewer: 0, origin: null, draw: drawPredictions, at: () => null }) });
const ghosts = /** @type {Field[]} */ (/** @type {unknown} */ ([{
	view: KEY, kind: 'ball', base: [{ box: [14, 22, 20, 20] }], mine: [{ box: [70, 12, 20, 20] }],
}]));
const PAINT = [...Array(30).keys()].map((i) => ({ x: 4 + 4.2 * i, y: 27 + Math.sin(i / 4) }));
const strip = (/** @type {'ok' | 'bad'} */ grade, /** @type {number} */ off, /** @type {{x: number, y: number}[]} */ paint = []) => (/** @type {CanvasRenderingContext2D} */ context) => {
	drawStrip(context, { width: WIDTH, height: HEIGHT }, lineOf(grade, off, { polyline: [{ x: 0, y: 25 }, { x: WIDTH, y: 25 }], points: [{ point: { x: 66, y: 25 + off }, nearest: { x: 66, y: 25 }, distance: off }] }), null, 1, { width: WIDTH, height: HEIGHT }, paint);
};

/** @type {Section} */
const PICTURES = {
	title: 'Lines in the pictures',
	rows: [
		{ name: 'Line that fits', meaning: 'A marking projected by the camera; all its annotated points are close. Blue, solid.', tokens: 'canvas-ok', draw: onGrass(sceneOf({ markings: [lineOf('ok', 1)] }), drawMarkings) },
		{ name: 'Doubtful line', meaning: 'A point is more than half as far off as JaC allows. Orange, long dashes.', tokens: 'canvas-warn', draw: onGrass(sceneOf({ markings: [lineOf('warn', 5)] }), drawMarkings) },
		{ name: 'Line that is wrong', meaning: 'A point is farther off than JaC allows, so the marking counts against the view. Red, short dashes.', tokens: 'canvas-bad', draw: onGrass(sceneOf({ markings: [lineOf('bad', 12)] }), drawMarkings) },
		{ name: 'Visible line, not drawn', meaning: 'It should be visible here but has no points: it counts as missed. White dots on black; yellow with its name when the card offers to draw it.', tokens: 'canvas-unseen canvas-point canvas-ink', draw: onGrass(sceneOf({ markings: [lineOf('unseen', null, { points: [] })] }), drawMarkings, drawUndrawn) },
		{ name: 'Annotated point', meaning: 'A point that a person clicked. White with a dark ring.', tokens: 'canvas-point canvas-ink', draw: onGrass(sceneOf({ markings: [lineOf('ok', 1)] }), drawMarkings, drawPoints) },
		{ name: 'Point of a wrong line', meaning: 'The ring is red.', tokens: 'canvas-bad', draw: onGrass(sceneOf({ markings: [lineOf('bad', 12)] }), drawMarkings, drawPoints) },
		{ name: 'Point that the camera does not use', meaning: 'The solver left its line out because it contradicts all others. Filled red.', tokens: 'canvas-bad', draw: onGrass(sceneOf({ markings: [lineOf('bad', 12, { used: false })] }), drawPoints) },
		{ name: 'Error line', meaning: 'Leads from the line to the annotated point; W makes it 1, 5 or 20 times as long as it is.', tokens: 'canvas-warn canvas-bad', draw: onGrass(sceneOf({ markings: [lineOf(gradeAt(12), 12)] }), drawMarkings, drawResidualLines, drawPoints) },
		{ name: 'Proposed line', meaning: 'Read from the paint of a picture without a camera. It is not used until a person accepts it (Enter, Shift P). Violet, dashed, its name with a question mark.', tokens: 'canvas-predicted', draw: onGrass(sceneOf({}), proposalDrawing({ 'Side line': [{ x: 6, y: 34 }, { x: 40, y: 30 }, { x: 126, y: 20 }] })) },
		{ name: 'Selected point', meaning: 'The yellow ring: arrows move this point.', tokens: 'canvas-selected', draw: onGrass(sceneOf({ markings: [lineOf('ok', 2, { marking: 'Side' })] }, { ...solid, viewport: { scale: 1, left: -50, top: 9 } }), drawPoints, drawSelectedPoint) },
		{ name: 'Note', meaning: 'A note that a person left at this place.', tokens: 'canvas-warn canvas-point canvas-plate', draw: onGrass(sceneOf({ pins: [{ at: { x: 22, y: 40 }, text: 'check this' }] }), drawPins) },
	],
};

/** @type {Section} */
const BALLS = {
	title: 'The ball in pictures and crops',
	rows: [
		{ name: 'Annotated box', meaning: 'What a person drew. Red, solid.', tokens: 'canvas-human', draw: onGrass(sceneOf({}, {}, [ballAt()]), drawBall) },
		{ name: 'Box marked out of view', meaning: 'A person said that the ball is not in the picture. Red dots.', tokens: 'canvas-human', draw: onGrass(sceneOf({}, {}, [ballAt({ out_of_view: true })]), drawBall) },
		{ name: 'Ball without a box', meaning: 'Only its place is known. Red ring.', tokens: 'canvas-human', draw: onGrass(sceneOf({}, {}, [ballAt({ box: null, point: [66, 26] })]), drawBall) },
		{ name: 'Fitting box', meaning: 'The box that the 3D ball would have here. White, dashed.', tokens: 'canvas-optimised', draw: onGrass(sceneOf({ ball: /** @type {any} */ ({ ...FIT, reprojected: null }), solved: /** @type {any} */ ({ included: true }) }), drawBall) },
		{ name: 'Outline and cross', meaning: 'Where the 3D ball lies in this picture. Green; where a person marked the ball it must lie on it.', tokens: 'canvas-reprojected', draw: onGrass(sceneOf({ ball: fit, outline: circle(66, 26, 12) }, { boxes: false }), drawBall) },
		{ name: 'Expected ball', meaning: 'The ball is not drawn here; the other views see it at the green cross, and in 95 of 100 cases within the dashed ring.', tokens: 'canvas-reprojected', draw: onGrass(sceneOf({ solved: expecting, outline: circle(66, 26, 9) }), drawExpected) },
		{ name: 'Placed ball', meaning: 'Placed automatically where the other views see it (Y). It is exported, but is no evidence until a person moves it. Green dots.', tokens: 'canvas-reprojected', draw: onGrass(sceneOf({}, {}, [ballAt({ inferred: true })]), drawBall) },
		{ name: 'Subject of the card', meaning: 'The point, line or view that the fix on the card (Enter) changes. Yellow.', tokens: 'canvas-selected', draw: onGrass(sceneOf({ markings: [lineOf('bad', 12, { marking: 'Side' })] }, { meant: /** @type {any} */ ({ marking: 'Side', index: 0, caption: 'point 1 of Side' }) }), drawMarkings, drawPoints, drawSuggestionMarks) },
		{ name: 'Selected ball', meaning: 'Yellow with corners: drag it, or its corners; arrows move it.', tokens: 'canvas-selected', draw: onGrass(sceneOf({}, { selected: { kind: 'ball', view: KEY } }, [ballAt()]), drawBall) },
		{ name: 'Several balls', meaning: 'More than one is marked: choose the one in play.', tokens: 'canvas-human', draw: onGrass(sceneOf({}, {}, [ballAt({ box: [10, 28, 14, 14] }), ballAt({ box: [70, 28, 14, 14] })]), drawBall) },
		{ name: 'Ray of another view', meaning: 'The ball of that view lies somewhere on this line. Dotted, in the colour of the view, with its letter.', tokens: 'view-b', draw: onGrass(sceneOf({ epipolars: [{ letter: 'B', points: [{ x: 130, y: 2 }, { x: 4, y: 48 }] }] }), drawEpipolars) },
		{ name: 'Sure prediction', meaning: 'A detector found a ball here. It is not used until a person accepts it (Y). Violet brackets.', tokens: 'canvas-predicted', draw: onGrass(predicted(true), drawPredictions) },
		{ name: 'Unsure prediction', meaning: 'The same with a low score. Dotted brackets.', tokens: 'canvas-predicted', draw: onGrass(predicted(false), drawPredictions) },
		{ name: 'Your version and the original', meaning: 'After a conflict: your version dotted in yellow, the version before both changes in grey.', tokens: 'canvas-selected canvas-muted', draw: onGrass(sceneOf({}, { ghosts }), drawGhosts) },
		{ name: 'Pixel grid', meaning: 'The borders of the frame’s own pixels, under the magnifying glass (hold Z).', tokens: 'canvas-grid canvas-stage', draw: (context) => {
			context.fillStyle = colours.value.stage;
			context.fillRect(0, 0, WIDTH, HEIGHT);
			drawPixelGrid(context, { scale: 13, left: 0, top: 0 }, { width: WIDTH, height: HEIGHT }, 1);
		} },
		{ name: 'View without a frame', meaning: 'The picture is missing on disk; lines and ball stand on plain green.', tokens: 'canvas-field', draw: (context) => {
			context.fillStyle = colours.value.field;
			context.fillRect(0, 0, WIDTH, HEIGHT);
			drawMarkings(context, sceneOf({ markings: [lineOf('ok', 1)] }));
		} },
	],
};

/** @type {Section} */
const STRIPS = {
	title: 'Line strips',
	rows: [
		{ name: 'Strip of a line that fits', meaning: 'The picture along a marking, straightened. The paint and the points must lie on the middle line.', tokens: 'canvas-grass canvas-ok canvas-point', draw: strip('ok', 1) },
		{ name: 'Strip of a wrong line', meaning: 'Points lie beside the middle line, which is red.', tokens: 'canvas-bad', draw: strip('bad', 9) },
		{ name: 'Paint that was read', meaning: 'The middle of the painted line, place by place, after Shift W here or E in the calibration editor. There red means that it lies elsewhere than the lines say, and orange is everything that looks like paint.', tokens: 'canvas-reprojected canvas-bad canvas-warn', draw: strip('ok', 1, PAINT) },
	],
};

/** @type {TimelineJson} */
const COLUMNS = /** @type {any} */ ({
	id: [1, 2, 3, 4, 5, 6], error_px: [2, 3, 30, 4, 2, null], passes: [true, true, false, true, true, null],
	status: ['accepted', 'deferred', 'rejected', 'accepted', 'unreviewed', 'unreviewed'], stale: [false, false, false, true, false, false],
});

/** @param {CanvasRenderingContext2D} context @param {number} position */
function timeline(context, position) {
	const style = getComputedStyle(document.documentElement);
	const get = (/** @type {string} */ name) => style.getPropertyValue(`--${name}`).trim();
	context.fillStyle = get('panel');
	context.fillRect(0, 0, WIDTH, HEIGHT);
	const look = { ok: get('ok'), warn: get('warn'), bad: get('bad'), muted: get('muted'), ink: get('ink'), grid: get('line'), head: get('focus') };
	drawCurve(context, { width: WIDTH, height: HEIGHT }, { columns: COLUMNS, span: { from: -0.5, to: 5.5 }, limit: 10, position }, look);
}

/** @type {Section} */
const TIMELINE = {
	title: 'Timeline of static cameras',
	rows: [
		{ name: 'Error and limit', meaning: 'A bar for each moment: blue passes, red fails (with a second mark above it); the dashed orange line is the limit, grey on top is not solved.', tokens: 'ok bad warn muted line', draw: (context) => timeline(context, -1) },
		{ name: 'Verdicts', meaning: 'Blocks at the foot: full is accepted, lower half rejected, upper half deferred; orange where something changed since.', tokens: 'ok bad muted warn', draw: (context) => timeline(context, -1) },
		{ name: 'Playhead', meaning: 'The group that is on screen.', tokens: 'focus', draw: (context) => timeline(context, 4) },
	],
};

/** @param {ComponentChildren} marks @returns {ComponentChildren} */
const pitch = (marks) => html`
	<svg class="legend__svg mini-pitch" viewBox="0 0 132 52" aria-hidden="true">
		<rect class="mini-pitch__grass" width="132" height="52" /><path class="mini-pitch__line" d="M66 0V52" stroke-width="1" />${marks}
	</svg>`;

/** @type {Section} */
const PITCH = {
	title: 'Small pitch',
	rows: [
		{ name: 'Pitch', meaning: 'Seen from above, with its lines.', tokens: 'pitch-grass pitch-line', part: pitch(null) },
		{ name: 'Camera and its ray', meaning: 'Where a camera stands, in the colour of its view, and the way to the ball that it sees.', tokens: 'view-a', part: pitch(html`<path class="mini-pitch__ray" data-letter="A" d="M20 40L108 14" stroke-width="1.3" /><g class="mini-pitch__camera" data-letter="A"><circle cx="20" cy="40" r="7" /><text x="20" y="43.6" font-size="10">A</text></g>`) },
		{ name: 'Ball of a valid pair', meaning: 'Where the rays of two views meet. Light ring.', tokens: 'ink-soft', part: pitch(html`<circle class="mini-pitch__pair" data-valid="true" cx="66" cy="26" r="4" stroke-width="1.5" />`) },
		{ name: 'Ball of a pair that fails', meaning: 'Where the rays of two views come closest, but too far apart. Red ring.', tokens: 'bad', part: pitch(html`<circle class="mini-pitch__pair" data-valid="false" cx="66" cy="26" r="4" stroke-width="1.5" />`) },
		{ name: '3D ball', meaning: 'The ball of all valid pairs.', tokens: 'pitch-ball', part: pitch(html`<circle class="mini-pitch__ball" cx="66" cy="26" r="4" stroke-width="1.5" />`) },
	],
};

/** @param {ComponentChildren} marks @returns {ComponentChildren} */
const scene = (marks) => html`<svg class="legend__svg legend__scene" viewBox="0 0 132 52" aria-hidden="true"><rect class="legend__scene-grass" y="22" width="132" height="30" />${marks}</svg>`;

/** @type {Section} */
const SCENE = {
	title: '3D view',
	rows: [
		{ name: 'Camera', meaning: 'A pyramid in the colour of its view; click it to look through it.', tokens: 'scene-view-a scene-view-b scene-view-c scene-view-d scene-view-e scene-view-f', part: scene(html`${LETTERS.map((letter, i) => html`<path class="legend__cone" data-letter=${letter} d=${`M${14 + i * 20} 12l-6 14h12z`} />`)}`) },
		{ name: 'Ray of a valid pair', meaning: 'From a camera to the ball that it sees; solid.', tokens: 'scene-valid', part: scene(html`<path class="legend__ray" data-valid="true" d="M8 8L120 40" />`) },
		{ name: 'Pair that fails', meaning: 'Where the rays of two views come closest, but too far apart; red.', tokens: 'scene-invalid', part: scene(html`<circle class="legend__pair" cx="66" cy="26" r="4" />`) },
		{ name: '3D ball, stem and shadow', meaning: 'The ball, the line down to the grass that shows its height, and its shadow.', tokens: 'scene-ball scene-stem scene-shadow', part: scene(html`<ellipse class="legend__shadow" cx="66" cy="42" rx="7" ry="2.5" /><path class="legend__stem" d="M66 12V42" /><circle class="legend__ball" cx="66" cy="12" r="5" />`) },
		{ name: 'Uncertainty', meaning: 'The ball lies inside with a probability of about 95 % (two sigma).', tokens: 'scene-ellipsoid', part: scene(html`<ellipse class="legend__ellipsoid" cx="66" cy="26" rx="30" ry="9" />`) },
		{ name: 'Most likely point', meaning: 'The point that fits all views at once; the pair average is shown beside it.', tokens: 'scene-best', part: scene(html`<circle class="legend__best" cx="66" cy="26" r="5" />`) },
		{ name: 'Pitch', meaning: 'Grass in stripes, lines and goals; around it ground and sky.', tokens: 'scene-sky scene-ground scene-grass scene-grass-stripe scene-line scene-goal', part: scene(html`<path class="legend__stripe" d="M44 22h44v30H44z" /><path class="legend__line" d="M4 46H128" /><path class="legend__goal" d="M50 30V14H82V30" />`) },
	],
};

/** @type {Section} */
const PAGE = {
	title: 'On every page',
	rows: [
		{ name: 'Views', meaning: 'Each view keeps its letter and its colour.', tokens: 'view-a view-b view-c view-d view-e view-f', part: html`<span class="legend__letters">${LETTERS.map((letter) => html`<span class="letter" data-letter=${letter}>${letter}</span>`)}</span>` },
		{ name: 'Good', meaning: 'Well within its threshold, or passed.', tokens: 'ok', part: html`<span data-grade="ok">✓ 1.2</span>` },
		{ name: 'Worth a look', meaning: 'Close to its threshold, or something to check.', tokens: 'warn', part: html`<span data-grade="warn">! 9.4</span>` },
		{ name: 'Failed', meaning: 'Beyond its threshold, or wrong.', tokens: 'bad', part: html`<span data-grade="bad">✗ 21.0</span>` },
		{ name: 'Not known', meaning: 'Not annotated, or not measured.', tokens: 'muted', part: html`<span data-grade="unseen">○ –</span>` },
		{ name: 'Predicted', meaning: 'Comes from a detector and no person has accepted it.', tokens: 'predicted', part: html`<span class="legend__predicted">┌ ┐ 0.93</span>` },
	],
};

/** Everything, in the order in which people meet it. @type {Section[]} */
export const LEGEND = [PAGE, PICTURES, BALLS, STRIPS, PITCH, SCENE, TIMELINE];
