import assert from 'node:assert/strict';
import { readdirSync, readFileSync } from 'node:fs';
import { describe, it } from 'node:test';

import { numberIn } from '../../static/lib/field.js';

const VIEWS = new URL('../../static/views/', import.meta.url);

/** Steps of the number fields of a file with a form: those written in the field, and those of a table of fields. */
function steps(file) {
	const source = readFileSync(new URL(file, VIEWS), 'utf8');
	const fields = source.includes('type="number"') && source.includes('onSubmit') ? [...source.matchAll(/\bstep(?:="|: ')([^"']+)["']/g)] : [];
	return fields.map(([, step]) => step);
}

describe('number fields', () => {
	it('take any fraction where they take one: a browser refuses what is no multiple of the step from min', () => {
		const files = readdirSync(VIEWS, { recursive: true }).filter((name) => name.endsWith('.js'));
		const found = files.flatMap((file) => steps(file).map((step) => ({ file, step })));
		assert.ok(found.length > 3);
		assert.deepEqual(found.filter(({ step }) => step !== 'any' && !Number.isInteger(Number(step))), []);
	});

	it('stay empty when they are emptied, instead of becoming 0', () => {
		const files = readdirSync(VIEWS, { recursive: true }).filter((name) => name.endsWith('.js'));
		const zeroed = /type="number"[^<]*\bNumber\(text\)(?! \|\|)/;
		assert.deepEqual(files.filter((file) => zeroed.test(readFileSync(new URL(file, VIEWS), 'utf8'))), []);
		assert.deepEqual(['', ' ', '0', '1.5'].map(numberIn), [null, null, 0, 1.5]);
	});
});
