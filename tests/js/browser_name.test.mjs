import assert from 'node:assert/strict';
import test from 'node:test';

import { browserName } from '../../static/lib/browser_name.js';

const CHROME = 'AppleWebKit/537.36 (KHTML, like Gecko) Chrome/141.0.0.0 Safari/537.36';
const WINDOWS = 'Mozilla/5.0 (Windows NT 10.0; Win64; x64)';
const MAC = 'Mozilla/5.0 (Macintosh; Intel Mac OS X 10_15_7)';

for (const [agent, name] of [
	[`${WINDOWS} ${CHROME}`, 'Chrome 141, Windows NT 10.0'],
	[`${WINDOWS} ${CHROME} Edg/140.0.0.0`, 'Edge 140, Windows NT 10.0'],
	[`${MAC} ${CHROME} OPR/120.0.0.0`, 'Opera 120, Macintosh'],
	['Mozilla/5.0 (X11; Linux x86_64; rv:140.0) Gecko/20100101 Firefox/140.0', 'Firefox 140, Linux x86_64'],
	[`${MAC} AppleWebKit/605.1.15 (KHTML, like Gecko) Version/18.4 Safari/605.1.15`, 'Safari 18, Macintosh'],
	[`${WINDOWS} ${CHROME.replace('Chrome', 'HeadlessChrome')}`, 'Chrome 141, Windows NT 10.0'],
	['Mozilla/5.0 (iPhone; CPU iPhone OS 18_4) AppleWebKit/605.1.15 Mobile/15E148 Safari/604.1', 'Safari 604, iPhone'],
	['python-httpx/0.28.1', 'python-httpx/0.28.1'],
	['', 'Unknown browser'],
]) {
	test(`a session is called “${name}”`, () => assert.equal(browserName(agent), name));
}
