// @ts-check
/** A map that keeps what was put into it last. */

/**
 * @template Key, Value
 * @extends {Map<Key, Value>}
 */
export class Kept extends Map {
	/** @param {number} most so many are kept */
	constructor(most) {
		super();
		this.most = most;
	}

	/** What is put in once more is the newest again. @param {Key} key @param {Value} value */
	set(key, value) {
		this.delete(key);
		super.set(key, value);
		const [oldest] = this.keys();
		if (this.size > this.most) this.delete(oldest);
		return this;
	}
}
