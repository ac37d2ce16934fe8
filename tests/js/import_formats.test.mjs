import assert from 'node:assert/strict';
import { describe, it } from 'node:test';

import { withFormat, withOption, withSourceKind } from '../../static/state/import_formats.js';

const CHOICE = { format: 'issia', kind: 'folder', options: { calibration: 'given', lines: { folder: 'lines' } } };

describe('what is chosen for an import', () => {
	it('forgets the options of a format when another is chosen, as their fields do', () => {
		const next = withFormat(CHOICE, 'sn-calibration');
		assert.deepEqual(next, { format: 'sn-calibration', kind: 'folder', options: {} });
		assert.deepEqual(withFormat(next, 'issia').options, {});
	});
	it('keeps them when the same format is guessed again', () => {
		assert.equal(withFormat(CHOICE, 'issia'), CHOICE);
	});
	it('forgets the lines when the files come from elsewhere', () => {
		assert.deepEqual(withSourceKind(CHOICE, 'upload'), { format: 'issia', kind: 'upload', options: { calibration: 'given' } });
		assert.equal(withSourceKind(CHOICE, 'folder'), CHOICE);
	});
	it('takes what a field says', () => {
		assert.deepEqual(withOption(CHOICE, CHOICE, 'calibration', undefined).options, { calibration: undefined, lines: { folder: 'lines' } });
	});
	it('takes nothing of a field that is shown no more', () => {
		const upload = withSourceKind(CHOICE, 'upload');
		assert.equal(withOption(CHOICE, upload, 'lines', { upload: 'a' }), CHOICE);
		assert.equal(withOption(withFormat(CHOICE, 'issia-3d'), CHOICE, 'lines', { folder: 'b' }).options.lines, undefined);
	});
});
