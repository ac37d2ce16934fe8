// @ts-check
/** Making an export and waiting for it. */

import { getExport, postExport } from '../api/client.js';

/** @import {ExportJson} from '../api/types.js' */

const POLL = 500;

export const FORMATS = [
	{ name: 'soccernet-v3d', label: 'SoccerNet-v3D', note: 'SNv3D.csv, splits and Labels-v3D.json' },
	{ name: 'issia-3d', label: 'ISSIA-3D', note: 'ISSIA-3D.csv and issia_calibration.json' },
	{ name: 'cameras', label: 'Cameras', note: 'one camera JSON for each view' },
	{ name: 'sn-calibration', label: 'sn-calibration lines', note: 'one line JSON for each view' },
	{ name: 'soccernet-v3', label: 'SoccerNet-v3', note: 'Labels-v3.json with your edits' },
];

/**
 * Make an export and wait until it can be fetched.
 *
 * @param {{dataset: string, format: string, all: boolean, boxes: string}} options
 * @returns {Promise<ExportJson>}
 */
export async function makeExport(options) {
	let made = await postExport(options);
	while (!made.content && !['failed', 'error'].includes(made.status)) {
		await new Promise((resolve) => { setTimeout(resolve, POLL); });
		made = await getExport(made.id);
	}
	if (!made.content) throw new Error(made.error ?? 'The export failed.');
	return made;
}

/** Let the browser save a file of the server. @param {string} url */
export function download(url) {
	const link = globalThis.document.createElement('a');
	link.href = url;
	link.download = '';
	globalThis.document.body.append(link);
	link.click();
	link.remove();
}
