// @ts-check
/** Cameras as frusta with their frames in them, and the rays of their balls. */

import {
	BufferAttribute, BufferGeometry, DoubleSide, Group, LinearFilter, Mesh, MeshBasicMaterial, SRGBColorSpace, Texture,
} from 'three';

import { colourOf } from './scene_colours.js';
import { segments } from './pitch.js';
import { toWorld } from './standpoints.js';
import { seenAt } from './values.js';

/** @import {Palette} from './scene_colours.js' */
/** @import {Stand} from './values.js' */

/** Cells of the mesh that carries a frame: fine enough that the lens does not show. */
const CELLS = 24;
/** Depth of a frame that stands behind everything, metres. */
const BACKDROP = 600;

/** @param {Stand} stand @param {Palette} palette @returns {Group} */
export function frustum(stand, palette) {
	const group = new Group();
	const colour = colourOf(palette, stand.letter);
	const [a, b, c, d] = stand.corners;
	const apex = stand.camera.C;
	const edges = [apex, a, apex, b, apex, c, apex, d, a, b, b, c, c, d, d, a];
	group.add(segments(edges, { colour, width: 1.8 }));
	group.add(segments(postOf(stand), { colour, width: 1, opacity: 0.5 }));
	group.name = `camera ${stand.letter}`;
	return group;
}

/** From the camera down to the ground: where on earth it stands. @param {Stand} stand */
function postOf({ camera: { C } }) {
	return [[...C], [C[0], C[1], 0]];
}

/** @param {Stand} stand @param {Palette} palette */
export function ray(stand, palette) {
	if (!stand.ray) return null;
	const colour = colourOf(palette, stand.letter);
	return segments([stand.camera.C, stand.ray], { colour, width: 1.8, dashed: !stand.used });
}

/**
 * The frame of a camera where the camera sees it, straightened by its own lens.
 *
 * @param {Stand} stand @param {ImageBitmap} image
 * @param {boolean} behind whether it is the backdrop of everything
 * @returns {Mesh}
 */
export function framePicture(stand, image, behind) {
	const map = new Texture(image);
	// A bitmap is never flipped on its way to the texture.
	map.flipY = false;
	map.colorSpace = SRGBColorSpace;
	map.minFilter = LinearFilter;
	map.generateMipmaps = false;
	map.needsUpdate = true;
	const material = new MeshBasicMaterial({
		map, side: DoubleSide, depthTest: !behind, depthWrite: false, transparent: !behind, opacity: behind ? 1 : 0.9,
	});
	const mesh = new Mesh(lensGrid(stand, behind ? BACKDROP : frameDepth(stand)), material);
	mesh.renderOrder = behind ? -10 : 1;
	// Behind a camera that stands far off nothing must be cut away.
	mesh.frustumCulled = false;
	return mesh;
}

/** Depth of the frustum's end along the camera's axis. @param {Stand} stand */
function frameDepth({ camera, corners }) {
	const offset = corners[0].map((value, i) => value - camera.C[i]);
	return camera.R[2].reduce((sum, value, i) => sum + value * offset[i], 0);
}

/** @param {Stand} stand @param {number} depth @returns {BufferGeometry} */
function lensGrid({ camera, size }, depth) {
	/** @type {Record<'places' | 'uvs' | 'faces', number[]>} */
	const { places, uvs, faces } = { places: [], uvs: [], faces: [] };
	for (let row = 0; row <= CELLS; row++) {
		for (let column = 0; column <= CELLS; column++) {
			const [u, v] = [column / CELLS, row / CELLS];
			const pixel = { x: u * size.width - 0.5, y: v * size.height - 0.5 };
			places.push(...toWorld(seenAt(camera, pixel, depth)));
			uvs.push(u, v);
			if (row === CELLS || column === CELLS) continue;
			const at = row * (CELLS + 1) + column;
			faces.push(at, at + CELLS + 1, at + 1, at + 1, at + CELLS + 1, at + CELLS + 2);
		}
	}
	const geometry = new BufferGeometry();
	geometry.setAttribute('position', new BufferAttribute(new Float32Array(places), 3));
	geometry.setAttribute('uv', new BufferAttribute(new Float32Array(uvs), 2));
	geometry.setIndex(faces);
	return geometry;
}
