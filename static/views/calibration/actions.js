// @ts-check
/** What a person does to the markings, by key, button or diagram. */

import { toImage } from '../../geometry/viewport.js';
import { plural } from '../../lib/format.js';
import { choice, commit, lines, mode, stageLines, view } from '../../state/calibration.js';
import {
	relabelled, sidesSwapped, withAdded, withInserted, withPoint, withoutMarking, withoutPoint,
} from '../../state/line_changes.js';
import { announce, explain } from '../../state/notice.js';
import { viewportOf } from '../../state/viewports.js';
import { panelKey } from './panel_key.js';

/** @import {ImagePoint} from '../../geometry/viewport.js' */

/** Choose a marking; while another is to be relabelled, give it this name. @param {string} name */
export function pickMarking(name) {
	const chosen = choice.value;
	if (mode.value === 'relabel' && chosen) {
		mode.value = 'select';
		if (chosen.marking === name) return;
		stageLines(relabelled(lines.value, chosen.marking, name), `${chosen.marking} relabelled as ${name}`);
		choice.value = { marking: name, index: null };
		announce(`${chosen.marking} relabelled as ${name}.`);
		return;
	}
	choice.value = { marking: name, index: null };
	// What is not there yet can only be drawn.
	mode.value = lines.value[name] ? 'select' : 'draw';
	const points = lines.value[name]?.length ?? 0;
	announce(points ? `${name}, ${plural(points, 'point')}.` : `${name}: click to set points.`);
}

/** Give the focus to the image. */
export function focusImage() {
	const panel = document.querySelector('.editor__panel');
	if (panel instanceof HTMLElement) panel.focus();
}

/** Begin or end to set points on the marking in hand. */
export function toggleDrawing() {
	if (!choice.value) explain('Choose a marking first.');
	else mode.value = mode.value === 'draw' ? 'select' : 'draw';
}

/** Begin or end to give the marking in hand another name. */
export function toggleRelabelling() {
	const chosen = choice.value;
	if (!chosen || !lines.value[chosen.marking]) explain('Choose an annotated marking first.');
	else mode.value = mode.value === 'relabel' ? 'select' : 'relabel';
}

/** One point more after the one in hand; the first one in the middle of what is shown. */
export function insertPoint() {
	const chosen = choice.value;
	const at = view.value;
	if (!chosen || !at) {
		explain('Choose a marking first.');
		return;
	}
	const points = lines.value[chosen.marking] ?? [];
	const [a, b] = [points[chosen.index ?? 0], points[(chosen.index ?? 0) + 1]];
	if (a && b) {
		const index = (chosen.index ?? 0) + 1;
		const middle = { x: (a.x + b.x) / 2, y: (a.y + b.y) / 2 };
		stageLines(withInserted(lines.value, chosen.marking, index, middle), `Point added to ${chosen.marking}`);
		choice.value = { marking: chosen.marking, index };
		return;
	}
	const added = withAdded(lines.value, chosen.marking, middleOf(at));
	stageLines(added.lines, `Point added to ${chosen.marking}`);
	choice.value = { marking: chosen.marking, index: added.index };
}

/** The image point in the middle of the panel. @param {{letter: string, width: number, height: number}} at @returns {ImagePoint} */
function middleOf(at) {
	const stage = document.querySelector('.editor__panel .image-panel__stage');
	const { width, height } = stage?.getBoundingClientRect() ?? at;
	return toImage(viewportOf(panelKey(at.letter), at, { width, height }), { x: width / 2, y: height / 2 });
}

/** Take the point in hand away, or the whole marking. */
export function deleteChosen() {
	const chosen = choice.value;
	if (!chosen || !lines.value[chosen.marking]) {
		explain('Choose an annotated marking first.');
		return;
	}
	if (chosen.index === null) {
		deleteMarking();
		return;
	}
	const next = withoutPoint(lines.value, chosen.marking, chosen.index);
	stageLines(next, `Point ${chosen.index + 1} of ${chosen.marking} deleted`);
	const left = next[chosen.marking]?.length ?? 0;
	choice.value = left ? { marking: chosen.marking, index: Math.min(chosen.index, left - 1) } : null;
	announce('Point deleted.');
}

export function deleteMarking() {
	const chosen = choice.value;
	if (!chosen || !lines.value[chosen.marking]) {
		explain('Choose an annotated marking first.');
		return;
	}
	stageLines(withoutMarking(lines.value, chosen.marking), `${chosen.marking} deleted`);
	announce(`${chosen.marking} deleted.`);
	choice.value = null;
}

/** Every marking gets the name that it has from the other side. */
export function swapAllSides() {
	if (Object.keys(lines.value).length === 0) {
		explain('There are no lines to swap.');
		return;
	}
	stageLines(sidesSwapped(lines.value), 'Sides swapped');
	choice.value = null;
	announce('Sides swapped; nothing is saved yet.');
}

/** @param {number} dx @param {number} dy image pixels */
export function nudgePoint(dx, dy) {
	const chosen = choice.value;
	const point = chosen && chosen.index !== null ? lines.value[chosen.marking]?.[chosen.index] : undefined;
	if (!chosen || chosen.index === null || !point) return;
	const next = withPoint(lines.value, chosen.marking, chosen.index, { x: point.x + dx, y: point.y + dy });
	stageLines(next, `Point ${chosen.index + 1} of ${chosen.marking} moved`, `nudge ${chosen.marking} ${chosen.index}`);
}

/** @param {1 | -1} step */
export function stepMarking(step) {
	const names = Object.keys(lines.value).sort();
	if (names.length === 0) {
		explain('No lines are annotated in this view.');
		return;
	}
	const at = choice.value ? names.indexOf(choice.value.marking) : step > 0 ? -1 : 0;
	const marking = names[(at + step + names.length) % names.length];
	choice.value = { marking, index: null };
	announce(`${marking}, ${plural(lines.value[marking].length, 'point')}.`);
}

/** @param {1 | -1} step */
export function stepPoint(step) {
	const chosen = choice.value;
	const points = chosen ? (lines.value[chosen.marking] ?? []) : [];
	if (!chosen || points.length === 0) {
		stepMarking(step);
		return;
	}
	const at = chosen.index ?? (step > 0 ? -1 : 0);
	const index = (at + step + points.length) % points.length;
	choice.value = { marking: chosen.marking, index };
	announce(`Point ${index + 1} of ${points.length}.`);
}

/** Save what is staged as one edit. */
export function save() {
	if (commit()) mode.value = 'select';
}
