// @ts-check
/** Guidelines in parts: Markdown, and pictures by the digest of their bytes. */

const PICTURE = /^!\[([^\]]*)\]\(([0-9a-f]{64})\)$/;

/**
 * The line of a picture: its words without what would end them.
 *
 * @param {string} words @param {string} digest
 */
export function pictureLine(words, digest) {
	return `![${words.replace(/[[\]\s]+/g, ' ').trim()}](${digest})`;
}

/** @param {string} text @returns {{text: string, digest: string | null}[]} a picture's text is what it shows, in words */
export function partsOf(text) {
	/** @type {{text: string, digest: string | null}[]} */
	const parts = [];
	for (const part of text.split(/\n{2,}/)) {
		const picture = PICTURE.exec(part.trim());
		const last = parts.at(-1);
		if (picture) parts.push({ text: picture[1], digest: picture[2] });
		else if (last && last.digest === null) last.text += `\n\n${part}`;
		else if (part.trim()) parts.push({ text: part, digest: null });
	}
	return parts;
}
