import assert from 'node:assert/strict';
import { readFileSync } from 'node:fs';
import { describe, it } from 'node:test';

const TOKENS = readFileSync(new URL('../../static/css/tokens.css', import.meta.url), 'utf8');
const [DARK, LIGHT] = [TOKENS.slice(0, TOKENS.indexOf('prefers-color-scheme')), TOKENS.slice(TOKENS.indexOf('prefers-color-scheme'))];

/** Relative luminance of a colour (WCAG 2.2). */
function luminance(scheme, name) {
	const [, hex] = scheme.match(new RegExp(`--${name}: #([0-9a-f]{6});`));
	const [r, g, b] = [0, 2, 4].map((at) => parseInt(hex.slice(at, at + 2), 16) / 255)
		.map((part) => (part <= 0.04045 ? part / 12.92 : ((part + 0.055) / 1.055) ** 2.4));
	return 0.2126 * r + 0.7152 * g + 0.0722 * b;
}

describe('focus ring', () => {
	for (const [name, scheme] of Object.entries({ dark: DARK, light: LIGHT })) {
		it(`stands out from every ground in the ${name} scheme`, () => {
			for (const ground of ['bg', 'panel', 'panel-raised', 'ticked']) {
				const [darker, lighter] = [luminance(scheme, 'focus'), luminance(scheme, ground)].sort((a, b) => a - b);
				const contrast = (lighter + 0.05) / (darker + 0.05);
				assert.ok(contrast >= 3, `${ground}: ${contrast.toFixed(2)}`);
			}
		});
	}
});
