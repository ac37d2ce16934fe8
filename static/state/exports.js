// @ts-check
/** Making an export and waiting for it. */

import { getExport, postExport } from '../api/client.js';
import { getJob } from '../api/jobs.js';
import { follow } from './jobs.js';

/** @import {JobJson} from '../api/jobs.js' */
/** @import {ExportJson} from '../api/types.js' */

export const FORMATS = [
	{ name: 'soccernet-v3d', label: 'SoccerNet-v3D', note: 'SNv3D.csv, splits and Labels-v3D.json' },
	{ name: 'soccernet-v3', label: 'SoccerNet-v3', note: 'Labels-v3.json with your edits' },
	{ name: 'issia-3d', label: 'ISSIA-3D', note: 'ISSIA-3D.csv and issia_calibration.json' },
	{ name: 'issia', label: 'ISSIA', note: 'one XGTF for each camera, and its lines' },
	{ name: 'coco', label: 'COCO', note: 'one JSON for each split, the 3D ball in extra fields' },
	{ name: 'yolo', label: 'YOLO', note: 'data.yaml and one text file for each image' },
	{ name: 'parquet', label: 'Parquet', note: 'views.parquet, one row for each view' },
	{ name: 'gamestate', label: 'Game state', note: 'Labels-GameState.json for each sequence' },
	{ name: 'touchline', label: 'Touchline', note: 'edits and verdicts, for another installation' },
	{ name: 'cameras', label: 'Cameras', note: 'a camera JSON for each view' },
	{ name: 'sn-calibration', label: 'sn-calibration', note: 'lines and a camera for each view, as its evaluator reads them' },
	{ name: 'tracks', label: 'Tracks', note: 'the ball over time: ball.csv, ball.parquet, events.csv' },
	{ name: 'tracab', label: 'TRACAB', note: 'the ball over time as a .dat file and its XML' },
	{ name: 'cdf', label: 'CDF', note: 'the ball over time in the Common Data Format' },
	{ name: 'npz', label: 'NumPy', note: 'the ball over time with its cameras, as arrays' },
];

/**
 * Make an export and wait until it can be fetched.
 *
 * @param {import('../api/client.js').ExportRequest} options
 * @param {(job: JobJson) => void} seen each time its job has moved
 * @param {AbortSignal} [signal]
 * @returns {Promise<ExportJson>}
 */
export async function makeExport(options, seen, signal) {
	const { id } = await postExport(options);
	// Asked for once more: a small one is written before anybody listens.
	const job = await follow(await getJob(Number(id), signal), seen, signal);
	if (job.state === 'failed') throw new Error(job.problem?.detail ?? 'The export failed.');
	if (job.state === 'cancelled') throw new Error('The export was cancelled.');
	return getExport(id);
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
