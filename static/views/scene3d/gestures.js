// @ts-check
/** The pointer over the 3D view: turns, shifts, comes closer, chooses a camera. */

import { lookThrough, goToPreset, standpoint } from '../../state/scene3d.js';
import { approached, shifted, turned } from './standpoints.js';

/** @import {SceneStage} from './stage.js' */

const CLICK = 3;
const TURN = 0.006;

/** @param {HTMLCanvasElement} element @param {SceneStage} stage @returns {() => void} */
export function attachOrbit(element, stage) {
	/** @type {{id: number, x: number, y: number, moved: number, shift: boolean} | null} */
	let held = null;

	/** @param {PointerEvent} event */
	function down(event) {
		if (held) return;
		held = {
			id: event.pointerId, x: event.clientX, y: event.clientY, moved: 0,
			shift: event.button !== 0 || event.shiftKey,
		};
		element.setPointerCapture(event.pointerId);
	}

	/** @param {PointerEvent} event */
	function move(event) {
		if (event.pointerId !== held?.id) return;
		const [dx, dy] = [event.clientX - held.x, event.clientY - held.y];
		held = { ...held, x: event.clientX, y: event.clientY, moved: held.moved + Math.hypot(dx, dy) };
		if (held.moved < CLICK) return;
		leaveCamera();
		if (!stage.orbit) return;
		const height = stage.size.height;
		stage.set(held.shift
			? shifted(stage.orbit, dx / height, dy / height) : turned(stage.orbit, -dx * TURN, dy * TURN));
	}

	/** @param {PointerEvent} event */
	function up(event) {
		if (event.pointerId !== held?.id) return;
		const { moved } = held;
		held = null;
		if (moved >= CLICK) return;
		const { left, top } = element.getBoundingClientRect();
		const letter = stage.cameraAt(event.clientX - left, event.clientY - top);
		if (letter) lookThrough(letter);
	}

	function lost() {
		held = null;
	}

	/** @param {WheelEvent} event */
	function wheel(event) {
		event.preventDefault();
		leaveCamera();
		if (stage.orbit) stage.set(approached(stage.orbit, Math.exp(event.deltaY * 0.0012)));
	}

	/** @param {Event} event */
	function menu(event) {
		event.preventDefault();
	}

	const attached = new AbortController();
	const { signal } = attached;
	element.addEventListener('pointerdown', down, { signal });
	element.addEventListener('pointermove', move, { signal });
	element.addEventListener('pointerup', up, { signal });
	element.addEventListener('pointercancel', lost, { signal });
	element.addEventListener('wheel', wheel, { passive: false, signal });
	element.addEventListener('contextmenu', menu, { signal });
	return () => attached.abort();
}

/** Whoever turns the scene has left the camera. */
export function leaveCamera() {
	if (standpoint.value.kind === 'camera') goToPreset('whole');
}
