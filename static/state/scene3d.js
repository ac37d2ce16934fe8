// @ts-check
/** The 3D view: whether it is shown, and from where one looks. */

import { signal } from '@preact/signals';

/** @typedef {'whole' | 'top' | 'side' | 'goal' | 'ball'} Preset */
/** @typedef {{kind: 'preset', preset: Preset} | {kind: 'camera', letter: string}} Standpoint */

/** Whether the 3D view stands where the images are otherwise. */
export const sceneShown = signal(false);
/** From where one looks; a new value, even an equal one, goes there again. */
export const standpoint = signal(/** @type {Standpoint} */ ({ kind: 'preset', preset: 'whole' }));

/** Show the 3D view, or the images again. */
export function toggleScene() {
	sceneShown.value = !sceneShown.value;
}

/** @param {Preset} preset */
export function goToPreset(preset) {
	standpoint.value = { kind: 'preset', preset };
}

/** Look through the camera of a view; through it already: step back. @param {string} letter */
export function lookThrough(letter) {
	const at = standpoint.value;
	if (at.kind === 'camera' && at.letter === letter) goToPreset('whole');
	else standpoint.value = { kind: 'camera', letter };
}
