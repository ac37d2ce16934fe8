import assert from 'node:assert/strict';
import { describe, it } from 'node:test';

import { stateOf } from '../../static/views/gates.js';

describe('stateOf', () => {
	const gate = { name: 'sigma', passed: false, active: true, value: null, threshold: 0.5, margin: null, sentence: 'not judged', view: null };
	const found = (change) => stateOf({ views: [] }, { ...gate, ...change }, [], false).state;

	it('tells a gate that fails without a number from one that is not judged', () => {
		assert.equal(found({ sentence: 'the lines of view B leave its camera open' }), 'failed');
		assert.equal(found({}), 'off');
		assert.equal(found({ name: 'chi_square', passed: true, sentence: 'not judged: a camera has no known uncertainty' }), 'off');
		assert.equal(found({ name: 'agreement', passed: true, sentence: 'no paint was read' }), 'off');
	});
});
