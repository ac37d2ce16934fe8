// @ts-check
/** A zip of files as they are, made in the browser: many files become one upload. */

/** @typedef {{path: string, file: File}} PathFile   path: with the folders that the file lies in */

const LOCAL = 0x04034b50;
const LISTED = 0x02014b50;
const END = 0x06054b50;
/** Names are UTF-8. */
const FLAGS = 0x0800;
const VERSION = 20;
/** 1980-01-01, the first day of a zip: the same files are the same upload whenever they are sent. */
const DAY = 0x0021;
/** A zip of this kind has no room for more. */
const MOST_FILES = 65_535;
const MOST_BYTES = 2 ** 32 - 1;

const CRC = Uint32Array.from({ length: 256 }, (_, start) => {
	let value = start;
	for (let bit = 0; bit < 8; bit += 1) value = value & 1 ? (value >>> 1) ^ 0xedb88320 : value >>> 1;
	return value;
});

/** CRC-32 of bytes. @param {Uint8Array} bytes */
export function crc32(bytes) {
	let value = 0xffffffff;
	for (const byte of bytes) value = CRC[(value ^ byte) & 0xff] ^ (value >>> 8);
	return (value ^ 0xffffffff) >>> 0;
}

/**
 * A record of a zip: numbers of two or four bytes, little end first.
 *
 * @param {[number, 2 | 4][]} fields
 * @returns {Uint8Array<ArrayBuffer>}
 */
function record(fields) {
	const view = new DataView(new ArrayBuffer(fields.reduce((sum, [, bytes]) => sum + bytes, 0)));
	let at = 0;
	for (const [value, bytes] of fields) {
		if (bytes === 2) view.setUint16(at, value, true);
		else view.setUint32(at, value, true);
		at += bytes;
	}
	return new Uint8Array(view.buffer);
}

/**
 * @param {PathFile[]} files
 * @param {string} name of the zip
 * @param {AbortSignal} [signal]
 * @returns {Promise<File>}
 */
export async function packFiles(files, name, signal) {
	const bytes = files.reduce((sum, { path, file }) => sum + file.size + 2 * path.length + 200, 0);
	if (files.length > MOST_FILES || bytes > MOST_BYTES) {
		throw new Error('Too many files for one upload: split them into several zip files, or import them from a folder on the server.');
	}
	/** @type {BlobPart[]} */
	const parts = [];
	/** @type {Uint8Array<ArrayBuffer>[]} */
	const list = [];
	let at = 0;
	for (const { path, file } of [...files].sort((a, b) => (a.path < b.path ? -1 : 1))) {
		signal?.throwIfAborted();
		const text = new TextEncoder().encode(path);
		const crc = crc32(new Uint8Array(await file.arrayBuffer()));
		/** @type {[number, 2 | 4][]} */
		const facts = [[VERSION, 2], [FLAGS, 2], [0, 2], [0, 2], [DAY, 2], [crc, 4], [file.size, 4], [file.size, 4], [text.length, 2], [0, 2]];
		const head = record([[LOCAL, 4], ...facts]);
		list.push(record([[LISTED, 4], [VERSION, 2], ...facts, [0, 2], [0, 2], [0, 2], [0, 4], [at, 4]]), text);
		parts.push(head, text, file);
		at += head.length + text.length + file.size;
	}
	const listed = list.reduce((sum, { length }) => sum + length, 0);
	const end = record([[END, 4], [0, 2], [0, 2], [files.length, 2], [files.length, 2], [listed, 4], [at, 4], [0, 2]]);
	return new File([...parts, ...list, end], name, { type: 'application/zip' });
}
