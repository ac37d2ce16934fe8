/** Guidelines in parts: a picture is read as it was written, whatever its file is called. */

import assert from 'node:assert/strict';
import test from 'node:test';

import { partsOf, pictureLine } from '../../static/lib/guideline_parts.js';

const DIGEST = '0123456789abcdef'.repeat(4);

for (const [name, words] of [['tight box.png', 'tight box.png'], ['goal [left].png', 'goal left .png'], [']', ''], ['a\n\nb.png', 'a b.png'], ['![x](y).png', '! x (y).png']]) {
	test(`a picture called ${JSON.stringify(name)} stands between what is above and below it`, () => {
		const parts = partsOf(`Above.\n\n${pictureLine(name, DIGEST)}\n\nBelow.`);
		assert.deepEqual(parts, [{ text: 'Above.', digest: null }, { text: words, digest: DIGEST }, { text: 'Below.', digest: null }]);
	});
}
