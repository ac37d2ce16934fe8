// @ts-check
/** A camera in the numbers that people judge it by, and what is odd about them. */

import { profileOf, unbend } from '../../geometry/fisheye.js';

/** @import {CalibrationJson, CameraJson, FindingJson, SolutionJson} from '../../api/types.js' */

/** @typedef {{name: string, label: string, value: number | null, digits: number, unit: string, sigma: number | null, title?: string}} CameraNumber */

/** Kinds of findings that speak about a camera. */
const ABOUT_CAMERAS = new Set(['implausible_camera', 'under_constrained', 'picture_geometry', 'camera_size', 'paint_disagrees', 'no_paint', 'sides_swapped', 'view_disagrees']);

/**
 * @param {CalibrationJson | null} calibration @param {{width: number, height: number}} size of the image, pixels
 * @returns {CameraNumber[]}
 */
export function cameraNumbers(calibration, size) {
	const { width } = size;
	const camera = calibration?.camera ?? null;
	const sigma = sigmaOf(calibration);
	const focal = camera ? camera.x_focal_length : null;
	const [x, y, z] = camera?.position_meters ?? [null, null, null];
	/** @param {string} name @param {string} label @param {number | null} value @param {number} digits @param {string} unit @returns {CameraNumber} */
	const row = (name, label, value, digits, unit) => ({ name, label, value, digits, unit, sigma: sigma[name] ?? null });
	return [
		row('pan', 'Pan', camera?.pan_degrees ?? null, 2, '°'),
		{ ...row('tilt', 'Tilt', camera?.tilt_degrees ?? null, 2, '°'), title: '90° is level' },
		row('roll', 'Roll', camera?.roll_degrees ?? null, 2, '°'),
		row('x', 'x', x, 2, ' m'),
		row('y', 'y', y, 2, ' m'),
		row('height', 'Height', z === null ? null : -z, 2, ' m'),
		row('focal', 'Focal length', focal, 0, ' px'),
		...pictureNumbers(camera, size, row),
		row('field', 'Field of view', camera ? fieldOf(camera, width) : null, 1, '°'),
		...(camera?.lens_coefficients ?? []).map((value, i) => row(`lens${i}`, lensTerm(camera, i), value, 4, '')),
		...(camera?.lens_coefficients ? [] : [row('k1', 'Distortion k1', camera ? k1Of(camera) : null, 3, '')]),
	];
}

/**
 * Aspect of the pixels and where the axis lies, for pictures that are not as they were taken.
 *
 * @param {CameraJson | null} camera @param {{width: number, height: number}} size pixels
 * @param {(name: string, label: string, value: number | null, digits: number, unit: string) => CameraNumber} row
 */
function pictureNumbers(camera, { width, height }, row) {
	if (!camera) return [];
	const wide = 100 * (camera.x_focal_length / camera.y_focal_length - 1);
	const aside = (100 * (camera.principal_point[0] - (width - 1) / 2)) / width;
	const below = (100 * (camera.principal_point[1] - (height - 1) / 2)) / height;
	if ([wide, aside, below].every((share) => Math.abs(share) < 0.1)) return [];
	return [
		row('wide', 'Pixel width error', wide, 1, ' %'),
		row('aside', 'Principal point, right', aside, 1, ' %'),
		row('below', 'Principal point, down', below, 1, ' %'),
	];
}

/**
 * Horizontal field of view, degrees.
 *
 * @param {CameraJson} camera @param {number} width pixels
 * @returns {number}
 */
function fieldOf(camera, width) {
	const edge = width / (2 * camera.x_focal_length);
	const profile = profileOf(camera.lens, camera.lens_coefficients);
	if (!profile) return (360 / Math.PI) * Math.atan(edge);
	const ideal = unbend([edge, 0], profile);
	return (360 / Math.PI) * (ideal ? Math.atan(ideal[0]) : profile.widest);
}

/** @param {CameraJson | null} camera @param {number} place of a coefficient */
function lensTerm(camera, place) {
	return camera?.lens === 'fisheye' ? `Fisheye k${place + 1}` : `Arctan polynomial a${place}`;
}

/** @param {CameraJson} camera */
function k1Of({ radial_distortion: radial }) {
	return radial?.[0] ?? 0;
}

/**
 * Standard deviations by name, where the server tells them.
 *
 * @param {CalibrationJson | null} calibration
 * @returns {Record<string, number | null>}
 */
function sigmaOf(calibration) {
	const sigma = calibration?.sigma;
	if (!sigma) return {};
	const [x, y, height] = sigma.position_meters;
	return {
		pan: sigma.pan_degrees, tilt: sigma.tilt_degrees, roll: sigma.roll_degrees, x, y, height,
		focal: sigma.focal_px, k1: sigma.k1,
	};
}

/**
 * What is odd about the camera of a view; nothing when it is as cameras are.
 *
 * @param {SolutionJson | null} solution @param {string} view @param {CalibrationJson | null} calibration
 * @returns {string[]}
 */
export function oddities(solution, view, calibration) {
	const told = (solution?.findings ?? []).filter((/** @type {FindingJson} */ finding) => (
		finding.view === view && ABOUT_CAMERAS.has(finding.kind)
	)).map(({ sentence }) => sentence);
	const open = calibration?.unobservable ?? [];
	if (open.length > 0) told.push(`The lines do not determine ${open.join(', ')}.`);
	if (calibration && !calibration.camera) told.push(calibration.reason ?? 'The lines do not determine a camera.');
	return told;
}
