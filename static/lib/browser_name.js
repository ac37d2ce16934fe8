// @ts-check
/** What a browser says of itself, in words. */

/** Those that call themselves Chrome or Safari, too, stand before these. @type {[string, RegExp][]} */
const BROWSERS = [
	['Edge', /\bEdg(?:A|iOS)?\/(\d+)/], ['Opera', /\bOPR\/(\d+)/], ['Firefox', /\b(?:Firefox|FxiOS)\/(\d+)/],
	['Chrome', /\b(?:Headless)?(?:Chrome|CriOS)\/(\d+)/], ['Safari', /\bVersion\/(\d+).* Safari\//], ['Safari', /\bSafari\/(\d+)/],
];
const LONGEST = 60;

/** The browser and the system of a session, as far as they say. @param {string} agent its `User-Agent` */
export function browserName(agent) {
	const system = /\((?:X11; )?([^;)]+)/.exec(agent);
	for (const [name, pattern] of BROWSERS) {
		const found = pattern.exec(agent);
		if (found) return `${name} ${found[1]}${system ? `, ${system[1]}` : ''}`;
	}
	return agent.slice(0, LONGEST) || 'Unknown browser';
}
