// @ts-check
/** An answer of the server that says what is wrong, in its own sentence. */

/** Nobody was reached, a proxy found the server away, or it is busy or full for now. */
const PASSING = new Set([0, 502, 503, 504, 507]);

export class ApiError extends Error {
	/**
	 * @param {number} status HTTP status; 0 when the server was not reached
	 * @param {any} body problem JSON, or null
	 * @param {number} [retryAfter] seconds after which the server wants to be asked again
	 */
	constructor(status, body, retryAfter = 0) {
		super(detailOf(status, body));
		this.name = 'ApiError';
		this.status = status;
		this.retryAfter = retryAfter;
		/** What to do about it, when the server says so. @type {string | null} */
		this.hint = body?.hint ?? null;
		/** Which field of the request is at fault. @type {string | null} */
		this.pointer = body?.pointer ?? null;
		/** Who has the group of a batch open. @type {{person: string, since: string}[] | null} */
		this.here = body?.here ?? null;
		/** The state as it is now, when somebody else was first. @type {any} */
		this.current = body?.current ?? null;
	}

	/** Whether somebody else changed the group first. */
	get isConflict() {
		return this.status === 412;
	}

	/** Whether the same request may succeed later. */
	get isPassing() {
		return PASSING.has(this.status);
	}
}

/** @param {number} status @param {any} body */
function detailOf(status, body) {
	if (status === 0) return 'The server cannot be reached. Is it still running?';
	if (typeof body?.detail === 'string') return body.detail;
	if (typeof body?.title === 'string') return body.title;
	return `The server responded with status ${status} and no explanation.`;
}

/** The sentence of what went wrong, for people. @param {unknown} error @returns {string} */
export function sentenceOf(error) {
	if (!(error instanceof Error)) return String(error);
	const hint = error instanceof ApiError ? error.hint : null;
	// A field is named as it stands in the form, and not as its place in the request.
	const text = error.message.replace(/^\/(\w+): /, '$1: ').replace(/[^.?!]$/, '$&.');
	return (text.charAt(0).toUpperCase() + text.slice(1)) + (hint ? ` ${hint}` : '');
}
