// @ts-check
/** The canvas of the 3D view: draws when something has changed, and gives everything back. */

import { Color, Group, Matrix4, PerspectiveCamera, Quaternion, Raycaster, Scene, Vector2, Vector3, WebGLRenderer } from 'three';

import { ballGroup } from './balls.js';
import { framePicture, frustum, ray } from './cameras.js';
import { pitchGroup, segments } from './pitch.js';
import { axesOf, between, cameraProjection, carried, eyeOf, freeProjection, toWorld } from './standpoints.js';

/** @import {Object3D} from 'three' */
/** @import {Palette} from './scene_colours.js' */
/** @import {Orbit} from './standpoints.js' */
/** @import {SceneValues, Stand} from './values.js' */

/** @typedef {{name: string, x: number, y: number, shown: boolean}} Place   CSS pixels */

const FLIGHT = 420;

export class SceneStage {
	/**
	 * @param {HTMLCanvasElement} canvas @param {WebGL2RenderingContext} context
	 * @param {(places: Place[]) => void} placed told after every drawing where the labels belong
	 */
	constructor(canvas, context, placed) {
		this.renderer = new WebGLRenderer({ canvas, context });
		this.scene = new Scene();
		this.camera = new PerspectiveCamera();
		this.camera.matrixAutoUpdate = false;
		this.size = { width: 1, height: 1 };
		/** @type {SceneValues | null} */
		this.values = null;
		/** @type {Map<string, ImageBitmap>} */
		this.images = new Map();
		/** @type {Palette | null} */
		this.palette = null;
		/** @type {Orbit | null} */
		this.orbit = null;
		/** @type {Stand | null} */
		this.through = null;
		/** The orbit of the preset, until somebody turns it. @type {Orbit | null} */
		this.preset = null;
		this.placed = placed;
		this.frame = 0;
		this.flight = 0;
		this.flying = false;
	}

	/** @param {number} width @param {number} height CSS pixels */
	resize(width, height) {
		this.size = { width, height };
		this.renderer.setPixelRatio(Math.min(2, devicePixelRatio));
		this.renderer.setSize(width, height, false);
		this.request();
	}

	get aspect() {
		return this.size.width / this.size.height;
	}

	/**
	 * Build everything anew.
	 *
	 * @param {SceneValues} values @param {Palette} palette @param {Map<string, ImageBitmap>} images by letter
	 */
	show(values, palette, images) {
		discard(this.scene);
		this.images = images;
		this.palette = palette;
		this.scene.background = new Color(palette.sky);
		this.scene.add(pitchGroup(values.pitch, palette));
		for (const stand of values.stands) this.scene.add(this.standing(stand, palette));
		this.move(values);
		if (this.through) this.lookThrough(this.through.letter);
	}

	/** The ball and its rays anew; cameras and pitch stay. @param {SceneValues} values of the cameras that are shown */
	move(values) {
		const { palette } = this;
		const before = this.scene.getObjectByName('moving');
		if (before) {
			this.scene.remove(before);
			discard(before);
		}
		this.values = values;
		if (!palette) return;
		const moving = new Group();
		moving.name = 'moving';
		const lines = values.stands.map((stand) => ray(seeing(stand, values), palette));
		moving.add(...lines.filter((line) => line !== null), ballGroup(values, palette));
		if (values.trail?.length) moving.add(segments(values.trail, { colour: palette.ball, width: 2.4, opacity: 0.75 }));
		this.scene.add(moving);
		this.request();
	}

	/** @param {Stand} stand @param {Palette} palette */
	standing(stand, palette) {
		const group = frustum(stand, palette);
		const image = this.images.get(stand.letter);
		if (image) group.add(framePicture(stand, image, false));
		return group;
	}

	/** Whether nobody has turned the scene since it went to a preset. */
	get untouched() {
		return this.preset !== null && (this.flying || this.orbit === this.preset);
	}

	/** Go to an orbit. @param {Orbit} orbit @param {boolean} smoothly */
	goTo(orbit, smoothly) {
		cancelAnimationFrame(this.flight);
		this.preset = orbit;
		this.flying = false;
		const from = this.orbit;
		this.leaveCamera();
		if (!from || !smoothly) {
			this.set(orbit);
			return;
		}
		const start = performance.now();
		const step = () => {
			const t = Math.min(1, (performance.now() - start) / FLIGHT);
			this.flying = t < 1;
			this.set(this.flying ? between(from, orbit, t * t * (3 - 2 * t)) : orbit);
			if (this.flying) this.flight = requestAnimationFrame(step);
		};
		step();
	}

	/** Move with what the preset looks at; how somebody has turned the scene stays. @param {Orbit} preset */
	follow(preset) {
		const [from, orbit] = [this.preset, this.orbit];
		if (!from || !orbit) return;
		this.preset = preset;
		this.set(carried(orbit, from, preset));
	}

	/** @param {Orbit} orbit */
	set(orbit) {
		this.orbit = orbit;
		this.request();
	}

	/** Look through the camera of a view. @param {string} letter */
	lookThrough(letter) {
		const stand = this.values?.stands.find((one) => one.letter === letter);
		if (!stand) return;
		cancelAnimationFrame(this.flight);
		this.leaveCamera();
		this.through = stand;
		const image = this.images.get(letter);
		if (image) {
			const backdrop = framePicture(stand, image, true);
			backdrop.name = 'backdrop';
			this.scene.add(backdrop);
		}
		this.scene.traverse((object) => {
			if (object.name === `camera ${letter}` || (image && object.name === 'ground')) object.visible = false;
		});
		this.request();
	}

	/** Step back out of a camera. */
	leaveCamera() {
		if (!this.through) return;
		this.through = null;
		const backdrop = this.scene.getObjectByName('backdrop');
		if (backdrop) {
			this.scene.remove(backdrop);
			discard(backdrop);
		}
		this.scene.traverse((object) => { object.visible = true; });
	}

	/** The letter of the camera at a place of the panel. @param {number} x @param {number} y @returns {string | null} */
	cameraAt(x, y) {
		const at = new Vector2((2 * x) / this.size.width - 1, 1 - (2 * y) / this.size.height);
		const caster = new Raycaster();
		caster.setFromCamera(at, this.camera);
		const frusta = this.scene.children.filter((object) => object.name.startsWith('camera') && object.visible);
		for (const { object } of caster.intersectObjects(frusta, true)) {
			/** @type {Object3D | null} */
			let up = object;
			while (up && !up.name) up = up.parent;
			if (up) return up.name.slice('camera '.length);
		}
		return null;
	}

	/** Draw with the next frame. */
	request() {
		if (this.frame) return;
		this.frame = requestAnimationFrame(() => {
			this.frame = 0;
			this.draw();
		});
	}

	draw() {
		if (!this.orbit && !this.through) return;
		this.pose();
		this.renderer.render(this.scene, this.camera);
		this.placed(this.places());
	}

	/** Put the camera where one looks from. */
	pose() {
		const { camera, through, orbit } = this;
		if (through) {
			const [right, up, back] = axesOf(through.camera).map((axis) => new Vector3(...axis));
			camera.position.set(...toWorld(through.camera.C));
			camera.quaternion.setFromRotationMatrix(new Matrix4().makeBasis(right, up, back));
			setProjection(camera, cameraProjection(through.camera, through.size, this.size));
		} else if (orbit) {
			camera.position.set(...eyeOf(orbit));
			camera.quaternion.copy(facing(camera.position, new Vector3(...orbit.target), orbit.azimuth));
			setProjection(camera, freeProjection(this.aspect));
		}
		camera.updateMatrix();
		camera.updateMatrixWorld(true);
	}

	/** Where cameras and ball stand in the panel. @returns {Place[]} */
	places() {
		const { values, through } = this;
		if (!values) return [];
		const ball = values.ball ?? values.best;
		return [
			...values.stands.map(({ letter, camera }) => {
				const place = this.placeOf(letter, camera.C);
				return { ...place, shown: place.shown && through?.letter !== letter };
			}),
			...(ball ? [this.placeOf('ball', ball.point)] : []),
		];
	}

	/** @param {string} name @param {readonly number[]} point @returns {Place} */
	placeOf(name, point) {
		const at = new Vector3(...toWorld(point)).project(this.camera);
		const shown = at.z < 1 && at.z > -1 && Math.abs(at.x) <= 1 && Math.abs(at.y) <= 1;
		return { name, x: ((at.x + 1) / 2) * this.size.width, y: ((1 - at.y) / 2) * this.size.height, shown };
	}

	/** Give back everything that the graphics card holds. */
	destroy() {
		cancelAnimationFrame(this.frame);
		cancelAnimationFrame(this.flight);
		discard(this.scene);
		this.renderer.dispose();
		this.renderer.forceContextLoss();
	}
}

/**
 * The rotation that looks from one point at another; straight down, the azimuth says what is up.
 *
 * @param {Vector3} eye @param {Vector3} target @param {number} azimuth
 */
function facing(eye, target, azimuth) {
	const up = new Vector3(-Math.sin(azimuth), 1e-3, -Math.cos(azimuth));
	const steep = Math.abs(eye.y - target.y) > 0.99 * eye.distanceTo(target);
	const matrix = new Matrix4().lookAt(eye, target, steep ? up : new Vector3(0, 1, 0));
	return new Quaternion().setFromRotationMatrix(matrix);
}

/** @param {PerspectiveCamera} camera @param {number[]} rows */
function setProjection(camera, rows) {
	camera.projectionMatrix.fromArray(rows).transpose();
	camera.projectionMatrixInverse.copy(camera.projectionMatrix).invert();
}

/** A camera with the ray of the ball, where a track says which cameras see it. @param {Stand} stand @param {SceneValues} values @returns {Stand} */
function seeing(stand, { seen, best }) {
	return seen ? { ...stand, used: true, ray: best && seen.has(stand.letter) ? best.point : null } : stand;
}

/** Free geometries, materials and textures below an object, and the objects. @param {Object3D} root */
function discard(root) {
	root.traverse((/** @type {any} */ object) => {
		object.geometry?.dispose();
		object.material?.map?.dispose();
		object.material?.dispose();
	});
	root.clear();
}
