// @ts-check
/** What an entry of a group's history says, in words. */

import { capital, words } from '../lib/format.js';
import { isFollowed } from './edits.js';
import { REASONS } from './reasons.js';

/** @import {LogEntryJson} from '../api/history.js' */

const MOST_NAMES = 3;
const TOLD = { said: 'Commented', edited: 'Changed a comment', deleted: 'Deleted a comment', resolved: 'Resolved a thread', reopened: 'Reopened a thread' };
const PLAIN = /** @type {Record<string, string>} */ ({
	import: 'Imported', camera: 'Imported a camera', pitch: 'Set the size of the pitch', position: 'Set the camera positions', paint: 'Read the paint in its pictures',
});

/** @param {string[]} names */
function listed(names) {
	const shown = names.slice(0, MOST_NAMES).map((name) => `“${name}”`).join(', ');
	return names.length > MOST_NAMES ? `${shown} and ${names.length - MOST_NAMES} more` : shown;
}

/** @param {Record<string, unknown> | undefined} lines @param {Record<string, string>} [source] */
function lineWords(lines, source = {}) {
	const names = Object.keys(lines ?? {});
	const hidden = names.filter((name) => source[name] === 'not_visible');
	const gone = names.filter((name) => lines?.[name] === null && !hidden.includes(name));
	const drawn = names.filter((name) => lines?.[name] !== null);
	return [drawn.length ? `drew ${listed(drawn)}` : '', gone.length ? `removed ${listed(gone)}` : '', hidden.length ? `marked ${listed(hidden)} as not visible` : ''].filter(Boolean).join(' and ') || 'changed lines';
}

/** @param {any[] | undefined} balls */
function ballWords(balls) {
	if (!balls?.length) return 'removed the ball';
	return isFollowed(balls[0].predicted_by) ? `accepted the ball ${balls[0].predicted_by}` : 'placed the ball';
}

/** @param {any} edit @param {(view: string) => string} letterOf */
function editWords(edit, letterOf) {
	const where = edit.view ? ` in ${letterOf(edit.view)}` : '';
	switch (edit.edit) {
		case 'set_lines': return `${lineWords(edit.lines, edit.source)}${where}`;
		case 'set_station_lines': return `${lineWords(edit.lines, edit.source)} of a static camera`;
		case 'set_balls': return `${ballWords(edit.balls)}${where}`;
		case 'include_view': return edit.included ? `included view ${letterOf(edit.view)}` : `left view ${letterOf(edit.view)} out${edit.reason ? `: ${reasonWords(edit.reason)}` : ''}`;
		case 'set_calibration': return `chose the ${edit.calibration} calibration${where}`;
		case 'set_picture': return `set how the picture was changed${where}`;
		case 'set_pitch': return `set the pitch to ${edit.length} × ${edit.width} m`;
		case 'set_noise': return 'set the annotation noise of cameras and people';
		case 'several': return edit.edits.map((/** @type {any} */ one) => editWords(one, letterOf)).join('; ');
		case 'set_station_camera': return 'set the camera of a static camera';
		default: return words(String(edit.edit ?? 'edited')).toLowerCase();
	}
}

/** @param {string} reason */
function reasonWords(reason) {
	return (REASONS.find(({ name }) => name === reason)?.label ?? words(reason)).toLowerCase();
}

/** @param {any} body */
function verdictWords({ state, reason, note, override }) {
	const why = reason ? ` because of ${reasonWords(reason)}` : override ? ` although ${words(override).toLowerCase()} fails` : '';
	return `${state === 'unreviewed' ? 'Withdrew the verdict' : capital(state)}${why}${note ? `: “${note.replaceAll('\n', ' · ')}”` : ''}`;
}

/** What became of somebody's own annotation. @param {string} kind @param {any} body */
function ownWords(kind, { did, person, reason, of = [] }) {
	if (did === 'handed back') return `Returned to ${person}${reason ? `: “${reason}”` : ''}`;
	if (did === 'reopened') return `The decision for ${person}’s annotation was undone: the group waits for a decision again`;
	if (kind === 'take') return `Applied ${person}’s independent annotation`;
	return did === 'agreed' ? `${of.join(' and ')} agree: ${person}’s annotation is used` : `Chose ${person}’s annotation`;
}

/** @param {LogEntryJson} entry @param {(view: string) => string} letterOf letter of a view's key @returns {string} */
export function sentenceOfEntry({ kind, body }, letterOf) {
	const plain = kind.replace('station_', '');
	if (kind === 'verdict') return verdictWords(body);
	if (kind === 'comment') return TOLD[/** @type {keyof typeof TOLD} */ (body?.did)] ?? TOLD.said;
	if (body?.person && (kind === 'take' || kind === 'agreement' || kind === 'work')) return ownWords(kind, body);
	if (!body?.edit || PLAIN[kind]) return PLAIN[kind] ?? capital(words(kind));
	const said = editWords(body.edit, letterOf);
	if (plain === 'undo') return `Undid: ${said}`;
	return plain === 'redo' ? `Redid: ${said}` : capital(said);
}

/** Kinds of entries that change what is drawn. */
const PICTURED = new Set(['edit', 'undo', 'redo', 'station_edit', 'station_undo', 'station_redo', 'import', 'camera']);

/** Whether there is a picture of what an entry has changed. @param {LogEntryJson} entry */
export function isPictured({ kind }) {
	return PICTURED.has(kind);
}
