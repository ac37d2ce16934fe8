/** Cameras whose numbers can be checked by hand, and a comparison of lists of numbers. */

import assert from 'node:assert/strict';

/** Main camera: 12 m up, 60 m from the middle of the pitch, 960 x 540. */
export const mainCamera = {
	pan_degrees: 8, tilt_degrees: 78, roll_degrees: 0,
	x_focal_length: 1500, y_focal_length: 1500, principal_point: [479.5, 269.5],
	position_meters: [0, 60, -12],
};

/** Behind the right goal, 6 m up. */
export const goalCamera = {
	pan_degrees: -90, tilt_degrees: 84, roll_degrees: 0.5,
	x_focal_length: 1200, y_focal_length: 1200, principal_point: [479.5, 269.5],
	position_meters: [75, 2, -6],
};

/** Every number of the first list is within `tolerance` of the second. */
export function close(actual, expected, tolerance = 1e-9) {
	assert.equal(actual.length, expected.length);
	actual.forEach((value, i) => {
		assert.ok(Math.abs(value - expected[i]) <= tolerance, `[${i}] ${value} is not ${expected[i]}`);
	});
}
