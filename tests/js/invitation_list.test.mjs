import assert from 'node:assert/strict';
import { test } from 'node:test';

import { readInvitations } from '../../static/lib/invitation_list.js';

test('a line is a person', () => {
	assert.deepEqual(readInvitations('\uFEFF# new\nanna,reviewer,anna@example.org\r\n\n ben , annotator\n"carl"\n'), [
		{ name: 'anna', role: 'reviewer', email: 'anna@example.org' },
		{ name: 'ben', role: 'annotator', email: null },
		{ name: 'carl', role: '', email: null },
	]);
});

test('a first line of columns says their order, with any divider', () => {
	for (const divider of [',', ';', '\t']) {
		const text = [['E-Mail', 'Name', 'Role'], ['a@b.org', 'anna', 'lead'], ['', 'ben', 'viewer']].map((line) => line.join(divider)).join('\n');
		assert.deepEqual(readInvitations(text), [
			{ name: 'anna', role: 'lead', email: 'a@b.org' },
			{ name: 'ben', role: 'viewer', email: null },
		]);
	}
});

test('cells beyond the last column are not dropped', () => {
	assert.equal(readInvitations('anna,lead,a@b.org,c@d.org')[0].email, 'a@b.org,c@d.org');
});

test('nothing is nobody', () => {
	assert.deepEqual(readInvitations('\n \n'), []);
});
