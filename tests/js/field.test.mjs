import assert from 'node:assert/strict';
import { describe, it } from 'node:test';

import { withForm, withTick, withValue } from '../../static/lib/field.js';

describe('listeners of fields', () => {
	it('are called with what the field holds', () => {
		const told = [];
		withValue((text) => told.push(text))({ target: { value: '7' } });
		withTick((ticked) => told.push(ticked))({ target: { checked: true } });
		assert.deepEqual(told, ['7', true]);
	});
});

describe('withForm', () => {
	it('tells what the form holds when it is sent, and keeps the browser from sending it', () => {
		globalThis.FormData = class { constructor(form) { this.of = form; } };
		const [told, form] = [[], { name: 'form' }];
		withForm((said, sent) => told.push(said.of, sent))({ preventDefault: () => told.push('kept'), currentTarget: form });
		assert.deepEqual(told, ['kept', form, form]);
	});
});
