// @ts-check
/** A list of people to invite, as somebody pastes it: a line of name, role and address for each. */

/** @import {InvitedPerson} from '../api/people.js' */

const COLUMNS = ['name', 'role', 'email'];

/**
 * The people of a list, with commas, semicolons or tabs between name, role and address. A first line of names of
 * columns says in which order they come; empty lines, and those that begin with #, are passed over. What is wrong
 * with a line, the server says.
 *
 * @param {string} text
 * @returns {InvitedPerson[]}
 */
export function readInvitations(text) {
	const divider = [',', ';', '\t'].reduce((best, one) => (text.split(one).length > text.split(best).length ? one : best));
	const lines = text.replace(/^\uFEFF/, '').split(/\r\n|\r|\n/)
		.map((line) => line.split(divider).map(plain))
		.filter((cells) => cells.some(Boolean) && !cells[0].startsWith('#'));
	const header = (lines[0] ?? []).map((cell) => cell.toLowerCase().replace('e-mail', 'email'));
	const named = header.includes('name') && header.every((cell) => COLUMNS.includes(cell));
	const columns = named ? header : COLUMNS;
	return lines.slice(named ? 1 : 0).map((cells) => {
		// Cells beyond the last column make its value one that the server refuses and shows.
		const values = [...cells.slice(0, columns.length - 1), cells.slice(columns.length - 1).filter(Boolean).join(',')];
		/** @param {string} column */
		const of = (column) => values[columns.indexOf(column)] ?? '';
		return { name: of('name'), role: of('role'), email: of('email') || null };
	});
}

/** A cell without its quotes. @param {string} cell */
function plain(cell) {
	const text = cell.trim();
	return /^".*"$/.test(text) ? text.slice(1, -1).replaceAll('""', '"').trim() : text;
}
