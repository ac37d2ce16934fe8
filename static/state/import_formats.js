// @ts-check
/** What can be imported, and what each format does not say itself. */

/** @typedef {{name: string, label: string, hint: string, kind: 'size' | 'calibration' | 'offset' | 'cameras' | 'grouping' | 'switch' | 'text'}} FormatOption */
/** @typedef {{name: string, label: string, note: string, options: FormatOption[], lines?: boolean, keepsPolicy?: boolean}} ImportFormat   `lines`: static cameras, whose lines are files of their own; `keepsPolicy`: no policy is chosen for it */

/** @type {FormatOption} */
const CALIBRATION = { name: 'calibration', label: 'If a view has both a camera and lines', hint: 'which of the two is used', kind: 'calibration' };
/** @type {FormatOption} */
const SIZE = { name: 'size', label: 'Size of the images', hint: 'width x height, for example 960x540; empty: the usual size of the format', kind: 'size' };
/** @type {FormatOption} */
const CATEGORY = { name: 'ball_category', label: 'Category of the ball', hint: 'name or id, if the category is not called ball or similar', kind: 'text' };
/** @type {FormatOption} */
const OFFSET = { name: 'frame_offset', label: 'Frame offset', hint: 'number in the ground truth minus number in the video: 8, or by camera 1=8,2=9', kind: 'offset' };
/** @type {FormatOption} */
const FLIPPED = { name: 'flipped', label: 'Mirrored cameras', hint: 'camera numbers, for example 2,6', kind: 'cameras' };

/** @type {FormatOption} */
const GROUPING = { name: 'grouping', label: 'Which pictures form one group', hint: 'a pattern of their names, with {instant} and {camera}', kind: 'grouping' };

/** @type {FormatOption} */
const PROPOSE = { name: 'propose', label: 'Propose cameras afterwards', hint: 'from the painted lines of the pictures; a job, which can be cancelled', kind: 'switch' };

/** @type {ImportFormat[]} */
export const IMPORT_FORMATS = [
	{ name: 'soccernet-v3', label: 'SoccerNet-v3', note: 'a folder or zip with Labels-v3.json', options: [] },
	{ name: 'soccernet-v3d', label: 'SoccerNet-v3D', note: 'Labels-v3D.json or SNv3D.csv', options: [CALIBRATION] },
	{ name: 'issia', label: 'ISSIA', note: 'XGTF ground truth of the static cameras', options: [CALIBRATION, SIZE, OFFSET, FLIPPED], lines: true },
	{ name: 'issia-3d', label: 'ISSIA-3D', note: 'ISSIA-3D.csv and issia_calibration.json', options: [CALIBRATION, SIZE, FLIPPED], lines: true },
	{ name: 'sn-calibration', label: 'sn-calibration', note: 'a JSON of lines for each frame', options: [CALIBRATION, SIZE] },
	{ name: 'cameras', label: 'Cameras', note: 'cameras of frames that are imported already', options: [{ ...SIZE, hint: 'the image size that the cameras belong to, for example 960x540; empty: the size of each view' }], keepsPolicy: true },
	{ name: 'gamestate', label: 'sn-gamestate', note: 'Labels-GameState.json', options: [CALIBRATION] },
	{ name: 'coco', label: 'COCO', note: 'as Touchline, CVAT, Label Studio, Roboflow or FiftyOne export it', options: [CALIBRATION, CATEGORY] },
	{ name: 'parquet', label: 'Parquet', note: 'as Touchline exports it', options: [] },
	{ name: 'frames', label: 'Pictures', note: 'without annotations: they become groups, cameras are proposed', options: [GROUPING, PROPOSE] },
	{ name: 'touchline', label: 'Touchline', note: 'edits and verdicts of another installation', options: [], keepsPolicy: true },
];

/**
 * What a person typed, as the server wants it; what cannot be read goes as it is, and the
 * server says what is wrong with it.
 *
 * @param {FormatOption} option @param {string} text
 * @returns {unknown} undefined: nothing was said
 */
export function optionValue({ kind }, text) {
	const said = text.trim();
	if (!said) return undefined;
	if (kind === 'size') {
		const found = /^(\d+)\s*[x×,]\s*(\d+)$/.exec(said);
		return found ? [Number(found[1]), Number(found[2])] : said;
	}
	if (kind === 'cameras') return said.split(/[\s,]+/).map((one) => (/^\d+$/.test(one) ? Number(one) : one));
	if (kind === 'offset') {
		if (/^-?\d+$/.test(said)) return Number(said);
		const pairs = said.split(/[\s,]+/).map((pair) => pair.split(/[=:]/));
		return Object.fromEntries(pairs.map(([camera, offset]) => [camera, /^-?\d+$/.test(offset ?? '') ? Number(offset) : offset ?? null]));
	}
	return said;
}

/** @typedef {{format: string, kind: 'upload' | 'folder', options: {[name: string]: any}}} ImportChoice   `kind`: where the files are; `options` are what the fields show */

/** Another format: its fields begin empty. @param {ImportChoice} choice @param {string} format @returns {ImportChoice} */
export function withFormat(choice, format) {
	return choice.format === format ? choice : { ...choice, format, options: {} };
}

/** Files of elsewhere: the field of the lines begins empty. @param {ImportChoice} choice @param {'upload' | 'folder'} kind @returns {ImportChoice} */
export function withSourceKind(choice, kind) {
	if (choice.kind === kind) return choice;
	const { lines: _, ...options } = choice.options;
	return { ...choice, kind, options };
}

/**
 * What a field says; nothing of a field that is shown no more, whose upload ended late.
 *
 * @param {ImportChoice} choice @param {ImportChoice} shown the choice for which the field was shown @param {string} name @param {unknown} value
 * @returns {ImportChoice}
 */
export function withOption(choice, shown, name, value) {
	const gone = shown.format !== choice.format || (name === 'lines' && shown.kind !== choice.kind);
	return gone ? choice : { ...choice, options: { ...choice.options, [name]: value } };
}
