// @ts-check
/** Files that a person dropped or chose, those inside folders too. */

/** @import {PathFile} from './zip_packing.js' */

const VIDEO = /\.(mp4|avi|mpe?g|mkv|mov|m4v|m?ts|m2ts|webm|wmv|flv|ogv|3gp)$/i;
const SYSTEM = /(^|\/)(\.|__MACOSX\/|thumbs\.db$|desktop\.ini$)/i;

/** Files of an input, with their folders where it chose one. @param {Iterable<File>} files @returns {PathFile[]} */
export function chosenFiles(files) {
	return [...files].map((file) => ({ path: file.webkitRelativePath || file.name, file })).filter(isOfPeople);
}

/** Files that were dropped. @param {DataTransfer} dropped @returns {Promise<PathFile[]>} */
export async function droppedFiles(dropped) {
	// Both lists are empty once the event is over.
	const entries = [...dropped.items].map((item) => (item.kind === 'file' ? item.webkitGetAsEntry() : null));
	const plain = chosenFiles(dropped.files);
	if (entries.every((entry) => !entry?.isDirectory)) return plain;
	/** @type {PathFile[]} */
	const found = [];
	for (const entry of entries) if (entry) await walk(entry, found);
	return found.filter(isOfPeople);
}

/** Whether there are videos and nothing that they could belong to. @param {PathFile[]} files */
export function areVideos(files) {
	return files.length > 0 && files.every(({ path }) => isVideo(path));
}

/** Whether a file is called as a video is. @param {string} name */
export function isVideo(name) {
	return VIDEO.test(name);
}

/** Files of operating systems are nobody's. @param {PathFile} file */
function isOfPeople({ path }) {
	return !SYSTEM.test(path);
}

/** @param {FileSystemEntry} entry @param {PathFile[]} found */
async function walk(entry, found) {
	if (entry.isFile) {
		const file = await new Promise((resolve, reject) => /** @type {FileSystemFileEntry} */ (entry).file(resolve, reject));
		found.push({ path: entry.fullPath.replace(/^\//, ''), file });
		return;
	}
	const reader = /** @type {FileSystemDirectoryEntry} */ (entry).createReader();
	for (;;) {
		// A reader gives a hundred entries at a time, and none at its end.
		const entries = await new Promise((resolve, reject) => reader.readEntries(resolve, reject));
		if (entries.length === 0) return;
		for (const inside of entries) await walk(inside, found);
	}
}
