// @ts-check
/**
 * One stream of events for all windows of a browser. A browser opens six connections to a server in
 * all its windows together, so the window that holds a lock reads the stream and tells the others.
 */

/**
 * @typedef {object} Reader
 * @property {(late: boolean) => void} opened the stream is there; `late`: it was before, or nobody knows since when
 *   it tells, so that something may have been missed
 * @property {() => void} lost
 * @property {(kind: string, data: string) => void} told
 */

const ADDRESS = '/api/v1/events';
const NAME = 'touchline-events';
const RETRY_MS = 5000;

/**
 * Read the stream until the returned function is called.
 *
 * @param {readonly string[]} kinds names of events
 * @param {Reader} reader
 * @param {string} [moment] how things stood when the page began to read: what came after it is told first
 * @returns {() => void}
 */
export function readStream(kinds, reader, moment = '') {
	// Without a secure context there are no locks; then each window has a stream of its own.
	if (!navigator.locks) return lead(kinds, reader, moment);
	const channel = new BroadcastChannel(NAME);
	const ended = new AbortController();
	let leads = false;
	let open = false;

	/** @type {Reader} */
	const all = {
		opened: (late) => {
			open = true;
			channel.postMessage({ what: 'opened' });
			reader.opened(late);
		},
		lost: () => {
			open = false;
			channel.postMessage({ what: 'lost' });
			reader.lost();
		},
		told: (kind, data) => {
			channel.postMessage({ what: 'told', kind, data });
			reader.told(kind, data);
		},
	};

	channel.onmessage = ({ data: message }) => {
		if (leads) {
			if (message.what === 'asked' && open) channel.postMessage({ what: 'open' });
		} else if (message.what === 'told') {
			reader.told(message.kind, message.data);
		} else if (message.what === 'opened' || (message.what === 'open' && !open)) {
			open = true;
			reader.opened(true);
		} else if (message.what === 'lost') {
			open = false;
			reader.lost();
		}
	};
	channel.postMessage({ what: 'asked' });
	navigator.locks
		.request(NAME, { signal: ended.signal }, () => {
			leads = true;
			const close = lead(kinds, all, moment);
			return new Promise((release) => {
				ended.signal.addEventListener('abort', () => {
					close();
					channel.close();
					release(null);
				});
			});
		})
		.catch(() => channel.close());
	return () => ended.abort();
}

/**
 * Read the stream in this window.
 *
 * @param {readonly string[]} kinds @param {Reader} reader @param {string} moment
 * @returns {() => void}
 */
function lead(kinds, reader, moment) {
	/** @type {EventSource} */
	let source;
	/** @type {ReturnType<typeof setTimeout> | undefined} */
	let retry;
	let late = moment === '';
	const open = () => {
		const stream = new EventSource(late ? ADDRESS : `${ADDRESS}?since=${moment}`);
		source = stream;
		stream.onopen = () => {
			reader.opened(late);
			late = true;
		};
		stream.onerror = () => {
			reader.lost();
			// The browser tries again by itself, but not after an answer that is no stream.
			if (stream.readyState === EventSource.CLOSED) retry = setTimeout(open, RETRY_MS);
		};
		for (const kind of kinds) {
			stream.addEventListener(kind, (event) => reader.told(kind, event.data));
		}
	};
	open();
	return () => {
		clearTimeout(retry);
		source.close();
	};
}
