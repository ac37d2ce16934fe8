// @ts-check
/** Marks that keep their size on screen: each meaning has a shape of its own. */

import { CanvasTexture, Sprite, SpriteMaterial, SRGBColorSpace } from 'three';

import { toWorld } from './standpoints.js';

/** @typedef {'disc' | 'diamond' | 'ring' | 'cross'} Shape */

const TEXTURE = 64;

/** @type {Record<Shape, (context: CanvasRenderingContext2D) => void>} */
const PATHS = {
	disc: (context) => context.arc(0, 0, 20, 0, 2 * Math.PI),
	ring: (context) => context.arc(0, 0, 20, 0, 2 * Math.PI),
	diamond: (context) => {
		for (const [x, y] of [[0, -25], [25, 0], [0, 25], [-25, 0]]) context.lineTo(x, y);
		context.closePath();
	},
	cross: (context) => {
		context.moveTo(-16, -16);
		context.lineTo(16, 16);
		context.moveTo(16, -16);
		context.lineTo(-16, 16);
	},
};

/** @param {Shape} shape @param {string} colour @param {string} halo */
function picture(shape, colour, halo) {
	const canvas = document.createElement('canvas');
	canvas.width = TEXTURE;
	canvas.height = TEXTURE;
	const context = /** @type {CanvasRenderingContext2D} */ (canvas.getContext('2d'));
	context.translate(TEXTURE / 2, TEXTURE / 2);
	context.beginPath();
	PATHS[shape](context);
	const filled = shape === 'disc' || shape === 'diamond';
	context.lineCap = 'round';
	context.strokeStyle = halo;
	context.lineWidth = filled ? 9 : 15;
	context.stroke();
	context.fillStyle = colour;
	context.strokeStyle = colour;
	context.lineWidth = 8;
	if (filled) context.fill();
	else context.stroke();
	return canvas;
}

/**
 * A mark at a point of the pitch frame.
 *
 * @param {Shape} shape @param {readonly number[]} point
 * @param {{colour: string, halo: string, size: number}} look size: share of the panel's height
 * @returns {Sprite}
 */
export function mark(shape, point, { colour, halo, size }) {
	const map = new CanvasTexture(picture(shape, colour, halo));
	map.colorSpace = SRGBColorSpace;
	const material = new SpriteMaterial({ map, sizeAttenuation: false, depthTest: false, transparent: true });
	const sprite = new Sprite(material);
	sprite.position.set(...toWorld(point));
	sprite.scale.setScalar(size);
	sprite.renderOrder = 10;
	return sprite;
}
