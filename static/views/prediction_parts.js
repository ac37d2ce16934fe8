// @ts-check
/** The way to predictions: what only groups with some need is fetched when one is met. */

import { signal } from '@preact/signals';
import { useEffect } from 'preact/hooks';

import { lazy } from '../lib/lazy.js';
import { explain } from '../state/notice.js';

/** @import {ViewPicture} from '../overlays/scene.js' */
/** @import {Predicted} from '../state/predictions.js' */

/** A group has been looked at for that long before anything of predictions is loaded, ms. */
const AFTER = 200;

const state = signal(/** @type {typeof import('../state/predictions.js') | null} */ (null));
/** @typedef {typeof import('../overlays/predictions.js') & typeof import('../overlays/prediction_places.js')} Overlay */
const overlay = signal(/** @type {Overlay | null} */ (null));

export const PredictionCard = lazy(async () => (await import('./prediction_card.js')).PredictionCard);
export const PredictionChip = lazy(async () => (await import('./prediction_chip.js')).PredictionChip);

/**
 * What was predicted for the group on screen, once that and what draws it are there.
 *
 * @param {boolean} painted whether a group is on screen
 * @returns {Predicted | null}
 */
export function usePredictions(painted) {
	const found = state.value?.predicted.value ?? null;
	useEffect(() => {
		if (!painted) return undefined;
		const timer = setTimeout(start, AFTER);
		return () => clearTimeout(timer);
	}, [painted]);
	useEffect(() => {
		if (found && !overlay.value) loadOverlay();
	}, [found !== null]);
	return overlay.value ? found : null;
}

function loadOverlay() {
	Promise.all([import('../overlays/predictions.js'), import('../overlays/prediction_places.js')]).then(
		([drawing, places]) => { overlay.value = { ...drawing, ...places }; },
		() => {},
	);
}

/** The server may be away: the next visit to a group tries again. */
function start() {
	import('../state/predictions.js').then((loaded) => {
		loaded.startPredictions();
		state.value = loaded;
	}, () => {});
}

/**
 * The views of a group with what was predicted in them.
 *
 * @param {ViewPicture[]} pictures @param {Predicted | null} predicted
 * @returns {ViewPicture[]}
 */
export function withPredictions(pictures, predicted) {
	const drawing = overlay.value;
	if (!predicted || !drawing) return pictures;
	return pictures.map((picture) => {
		const own = predicted.views.get(picture.view.key);
		if (!own) return picture;
		/** @type {ViewPicture['predictions']} */
		const predictions = {
			...own,
			draw: drawing.drawPredictions,
			at: (viewport, place) => drawing.markAt(drawing.placeMarks(own.marks, viewport, picture.view.width), place),
		};
		return { ...picture, predictions };
	});
}

/** Whether something is predicted in the group on screen. */
export function hasPredictions() {
	return (state.value?.predicted.value?.views.size ?? 0) > 0;
}

/** Accept the selected prediction, else the surest of the view in hand. */
export function acceptInHand() {
	if (state.value) state.value.acceptInHand();
	else explain('Nothing is predicted here.');
}

/** Accept the surest prediction of every view without a ball. */
export function acceptAll() {
	if (state.value) state.value.acceptAll();
	else explain('Nothing is predicted here.');
}
