// @ts-check
/** Keys of matches and groups as people read them. */

const MATCH = /^(.+)\/([^/]+)\/(\d{4}-\d\d-\d\d) - (\d\d)-(\d\d) ([^/]+?)(?:\/([^/]+))?$/;

/**
 * "league/2025-2026/2025-08-16 - 16-00 A 5 - 0 B/0.png" -> "A 5 – 0 B, 0.png" of "league, 16 ...".
 *
 * @param {string} key of a match, or of a group, whose picture then follows
 * @returns {{name: string, aside: string}} `aside` is empty where the key is another's
 */
export function matchName(key) {
	const found = MATCH.exec(key);
	if (!found) return { name: key, aside: '' };
	const [, league, season, day, hour, minute, teams, picture] = found;
	const name = teams.replace(/ (\d+) - (\d+) /, ' $1 – $2 ');
	return {
		name: picture ? `${name}, ${picture}` : name,
		aside: `${league.replaceAll('_', ' ')} ${season} · ${day} ${hour}:${minute}`,
	};
}
