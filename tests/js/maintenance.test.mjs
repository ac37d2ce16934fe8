import assert from 'node:assert/strict';
import { test } from 'node:test';

globalThis.sessionStorage = { getItem: () => null, setItem() {} };
globalThis.document = { addEventListener() {}, removeEventListener() {}, hidden: true, documentElement: { dataset: {}, hasAttribute: () => false } };
const { banner, isTime, nextChange, hideBanner, shownBanner, publishBanner } = await import('../../static/state/maintenance.js');

const AT = Date.parse('2030-01-01T12:00:00Z');
const one = { text: 'Upgrade', starts: '2030-01-01T12:00:00Z', until: '2030-01-01T13:00:00Z' };

test('a notice is shown from its beginning until its end', () => {
	assert.deepEqual([AT - 1, AT, AT + 3_599_999, AT + 3_600_000].map((at) => isTime(one, at)), [false, true, true, false]);
	assert.equal(isTime({ ...one, starts: null, until: null }, 0), true);
});

test('the next change is its beginning, then its end, then none', () => {
	assert.equal(nextChange(one, AT - 5), AT);
	assert.equal(nextChange(one, AT), AT + 3_600_000);
	assert.equal(nextChange(one, AT + 3_600_000), null);
});

test('one that was put away comes back when it changes', () => {
	const plain = { text: 'Upgrade', starts: null, until: null };
	publishBanner(plain);
	assert.deepEqual(shownBanner.value, plain);
	hideBanner();
	assert.equal(shownBanner.value, null);
	publishBanner({ ...plain });
	assert.equal(shownBanner.value, null);
	publishBanner({ ...plain, text: 'Later' });
	assert.equal(shownBanner.value?.text, 'Later');
	publishBanner(undefined);
	assert.equal(banner.value?.text, 'Later');
	publishBanner(null);
	assert.equal(shownBanner.value, null);
});
