/** Events: a page is told what others did since it began to read, or asks for it once more. */

import assert from 'node:assert/strict';
import { afterEach, describe, it } from 'node:test';

/** @type {any[]} */
const streams = [];
/** @type {(() => void)[]} */
const ends = [];
let copies = 0;

class Stream {
	constructor(address) {
		this.address = address;
		this.kinds = {};
		streams.push(this);
	}

	addEventListener(kind, hear) { this.kinds[kind] = hear; }

	close() {}
}

/** A fresh copy of the module, in a page that says how things stood, or does not. */
async function page(moment) {
	const listening = { addEventListener() {}, removeEventListener() {} };
	globalThis.document = { ...listening, hidden: false, documentElement: { dataset: { moment } } };
	globalThis.EventSource = Stream;
	// Without locks each window has a stream of its own.
	Object.defineProperty(globalThis, 'navigator', { value: {}, configurable: true });
	streams.length = 0;
	copies += 1;
	return import(`../../static/api/events.js?copy=${copies}`);
}

/** What is heard and missed of some kinds. */
function listenTo(events, ...kinds) {
	const said = [];
	for (const kind of kinds) {
		ends.push(events.listen(kind, (data) => said.push(`${kind} ${data.group}`), () => said.push(`missed ${kind}`)));
	}
	return said;
}

afterEach(() => {
	for (const end of ends.splice(0)) end();
});

describe('the first stream of a page', () => {
	it('tells what came after the page was made', async () => {
		const events = await page('12-3');
		const said = listenTo(events, 'group', 'dataset');
		assert.equal(streams[0].address, '/api/v1/events?since=12-3');
		streams[0].onopen();
		streams[0].kinds.group({ data: '{"group": 7}' });
		assert.deepEqual(said, ['group 7']);
	});

	it('lets be asked for what no log keeps', async () => {
		const events = await page('12-3');
		const said = listenTo(events, 'group', 'job', 'work');
		streams[0].onopen();
		assert.deepEqual(said, ['missed job', 'missed work']);
	});

	it('begins where the session said, and the first answer counts', async () => {
		const events = await page();
		events.beginsAt('5-0');
		events.beginsAt('9-0');
		listenTo(events, 'group');
		assert.equal(streams[0].address, '/api/v1/events?since=5-0');
	});

	it('lets everything be asked for where nobody knows when the page began', async () => {
		const events = await page();
		events.beginsAt(null);
		const said = listenTo(events, 'group', 'dataset');
		assert.equal(streams[0].address, '/api/v1/events');
		streams[0].onopen();
		assert.deepEqual(said, ['missed group', 'missed dataset']);
	});
});

describe('a later stream', () => {
	it('does not tell everything since the page was made once more, but lets it be asked for', async () => {
		const events = await page('12-3');
		listenTo(events, 'group');
		streams[0].onopen();
		for (const end of ends.splice(0)) end();
		const said = listenTo(events, 'group');
		assert.equal(streams[1].address, '/api/v1/events');
		streams[1].onopen();
		assert.deepEqual(said, ['missed group']);
	});
});
