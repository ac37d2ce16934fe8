// @ts-check
/** The canvas of one panel: the frame below, the overlays above, drawn from a Scene. */

import { colours } from '../lib/colours.js';
import { nextFrame } from '../lib/drawing.js';
import Konva from '../lib/konva.js';
import { drawBall } from './ball.js';
import { drawEpipolars } from './epipolars.js';
import { drawExpected } from './expected_ball.js';
import { drawGhosts } from './ghosts.js';
import { drawMarkings } from './markings.js';
import { drawSuggestionMarks } from './suggestion_marks.js';
import { drawPins } from './pins.js';
import { drawPoints, drawSelectedPoint, drawResidualLines } from './points.js';
import { drawUndrawn } from './undrawn.js';

/** @import {Scene} from './scene.js' */

/** Above this magnification pixels are shown as what they are. */
const UNSMOOTHED_FROM = 3;

export class ImageStage {
	/** @param {HTMLDivElement} container */
	constructor(container) {
		this.stage = new Konva.Stage({ container, listening: false, width: 1, height: 1 });
		this.below = new Konva.Layer({ listening: false });
		this.above = new Konva.Layer({ listening: false });
		this.picture = new Konva.Image({ image: undefined, listening: false });
		/** @type {Scene | null} */
		this.scene = null;
		this.size = { width: 1, height: 1 };
		/** Layers that do not show what they should. @type {Set<InstanceType<typeof Konva.Layer>>} */
		this.stale = new Set();
		this.drawing = nextFrame(() => this.drawStale());
		this.overlay = new Konva.Shape({
			listening: false,
			sceneFunc: (context) => {
				if (this.scene && !this.scene.hidden) drawOverlays(context._context, this.scene);
			},
		});
		this.below.add(this.picture);
		this.above.add(this.overlay);
		this.stage.add(this.below, this.above);
	}

	/** The size that the next drawing has. @param {number} width @param {number} height CSS pixels */
	resize(width, height) {
		this.size = { width, height };
	}

	/** @param {ImageBitmap | null} image */
	show(image) {
		this.picture.image(image ?? undefined);
		// Without a frame the markings stand on grass.
		this.picture.fill(image ? '' : colours.value.field);
		if (this.scene) this.drawSoon(this.below);
	}

	/** Brightness and contrast of the frame alone. @param {string} filter as CSS writes it */
	adjust(filter) {
		this.below.getNativeCanvasElement().style.filter = filter;
	}

	/** @param {Scene} scene */
	draw(scene) {
		const { viewport, picture } = scene;
		const moved = this.scene?.viewport !== viewport || this.scene?.picture.view !== picture.view;
		this.scene = scene;
		if (moved) {
			// The frame may have more pixels than were annotated: it is scaled to their size.
			this.picture.setAttrs({
				image: this.picture.image(),
				x: viewport.left,
				y: viewport.top,
				width: picture.view.width * viewport.scale,
				height: picture.view.height * viewport.scale,
			});
			this.below.imageSmoothingEnabled(viewport.scale < UNSMOOTHED_FROM);
			this.drawSoon(this.below);
		}
		this.drawSoon(this.above);
	}

	/** Draw a layer with the next frame: a page that loads changes it many times before. @param {InstanceType<typeof Konva.Layer>} layer */
	drawSoon(layer) {
		this.stale.add(layer);
		this.drawing.ask();
	}

	/** Draw what is stale, in the size that it has by now. */
	drawStale() {
		const { width, height } = this.size;
		if (this.stage.width() !== width || this.stage.height() !== height) {
			// Konva draws for the width and once more for the height, unless there is nothing to be seen.
			this.stage.visible(false);
			this.stage.size({ width, height });
			this.stage.visible(true);
			this.stale.add(this.below).add(this.above);
		}
		for (const layer of this.stale) layer.draw();
		this.stale.clear();
	}

	/** Free the canvases. */
	destroy() {
		this.drawing.cancel();
		this.stage.destroy();
	}
}

/** Everything that stands on a frame. @param {CanvasRenderingContext2D} context @param {Scene} scene */
export function drawOverlays(context, scene) {
	context.save();
	if (scene.projections) drawMarkings(context, scene);
	if (scene.projections) drawUndrawn(context, scene);
	if (scene.projections) (scene.picture.paint?.draw ?? drawResidualLines)(context, scene);
	if (scene.rays) drawEpipolars(context, scene);
	drawPoints(context, scene);
	scene.picture.proposal?.draw(context, scene);
	scene.picture.followed?.(context, scene);
	if (scene.boxes) scene.picture.predictions?.draw(context, scene);
	drawExpected(context, scene);
	drawBall(context, scene);
	drawSuggestionMarks(context, scene);
	drawSelectedPoint(context, scene);
	drawGhosts(context, scene);
	drawPins(context, scene);
	context.restore();
}
