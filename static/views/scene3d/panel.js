// @ts-check
/** The 3D view, its labels and presets. Loaded when somebody asks for it. */

import { html } from 'htm/preact';
import { useEffect, useMemo, useRef, useState } from 'preact/hooks';

import { spreadApart } from '../../geometry/spread.js';
import { colours } from '../../lib/colours.js';
import { metres } from '../../lib/format.js';
import { useKeys, useSize } from '../../lib/hooks.js';
import { useFrames } from '../../state/frames.js';
import { goToPreset, lookThrough, standpoint, toggleScene } from '../../state/scene3d.js';
import { attachOrbit } from './gestures.js';
import { sceneKeys } from './keys.js';
import { readPalette } from './scene_colours.js';
import { SceneStage } from './stage.js';
import { presetOrbit } from './standpoints.js';
import { SceneTable } from './table.js';
import { sceneOf } from './values.js';

/** @import {GroupDocument, SolutionJson} from '../../api/types.js' */
/** @import {Preset} from '../../state/scene3d.js' */
/** @import {Habits} from './keys.js' */
/** @import {Place} from './stage.js' */
/** @import {SceneValues} from './values.js' */

/** @type {{preset: Preset, label: string, key: string}[]} */
const PRESETS = [
	{ preset: 'whole', label: 'Whole', key: '0' },
	{ preset: 'top', label: 'Top', key: '7' },
	{ preset: 'side', label: 'Side', key: '8' },
	{ preset: 'goal', label: 'Goal', key: '9' },
	{ preset: 'ball', label: 'Ball', key: 'Z' },
];

const calm = matchMedia('(prefers-reduced-motion: reduce)');

/** Letters of cameras stand above them, at least this far apart, CSS pixels. */
const ABOVE = 18;
const APART = 26;

/** Move the labels to where their things are drawn. @param {HTMLElement | null} layer @param {Place[]} places */
function placeLabels(layer, places) {
	if (!layer) return;
	const { width, height } = layer.getBoundingClientRect();
	const box = { left: 13, top: 13, right: Math.max(13, width - 13), bottom: Math.max(13, height - 13) };
	const letters = places.filter(({ name, shown }) => shown && name !== 'ball');
	const apart = spreadApart(letters.map(({ x, y }) => ({ x, y: y - ABOVE })), APART, box);
	const spread = new Map(letters.map(({ name }, i) => [name, apart[i]]));
	for (const place of places) {
		const { name, shown } = place;
		const label = /** @type {HTMLElement | null} */ (layer.querySelector(`[data-label="${name}"]`));
		if (!label) continue;
		const { x, y } = spread.get(name) ?? place;
		label.hidden = !shown;
		label.style.transform = `translate(${x.toFixed(1)}px, ${y.toFixed(1)}px)`;
		const leader = layer.querySelector(`[data-leader="${name}"]`);
		const far = shown && Math.hypot(x - place.x, y - place.y) > ABOVE + 4;
		leader?.setAttribute('d', far ? `M${x.toFixed(1)} ${y.toFixed(1)}L${place.x.toFixed(1)} ${place.y.toFixed(1)}` : '');
	}
}

/** @param {{scene: SceneValues, images: Map<string, ImageBitmap>, habits?: Habits}} props */
export function Stage({ scene, images, habits }) {
	const [ref, size] = useSize();
	const labels = useRef(/** @type {HTMLDivElement | null} */ (null));
	const canvas = useRef(/** @type {HTMLCanvasElement | null} */ (null));
	const [stage, setStage] = useState(/** @type {SceneStage | null} */ (null));
	const [missing, setMissing] = useState(false);

	useEffect(() => {
		const element = /** @type {HTMLCanvasElement} */ (canvas.current);
		const context = element.getContext('webgl2', { antialias: true });
		if (!context) {
			setMissing(true);
			return undefined;
		}
		const made = new SceneStage(element, context, (places) => placeLabels(labels.current, places));
		const detach = attachOrbit(element, made);
		setStage(made);
		return () => { detach(); made.destroy(); };
	}, []);

	const theme = colours.value;
	useEffect(() => {
		if (stage && size.width > 0) stage.resize(size.width, size.height);
	}, [stage, size.width, size.height]);
	const drawn = useRef(/** @type {unknown[]} */ ([]));
	useEffect(() => {
		if (!stage) return;
		const fixed = [stage, scene.stands, images, theme];
		if (fixed.every((one, i) => one === drawn.current[i])) stage.move(scene);
		else stage.show(scene, readPalette(), images);
		drawn.current = fixed;
	}, [stage, scene, images, theme]);
	const at = standpoint.value;
	const ready = stage !== null && size.width > 0;
	useEffect(() => {
		if (!stage || !ready) return;
		if (at.kind === 'camera') stage.lookThrough(at.letter);
		else stage.goTo(presetOrbit(at.preset, scene, stage.aspect), !calm.matches);
	}, [stage, ready, at]);
	// Another group or another panel asks for another distance, unless somebody has turned the scene: then the ball is followed.
	useEffect(() => {
		if (!stage || at.kind !== 'preset') return;
		const orbit = presetOrbit(at.preset, scene, stage.aspect);
		if (stage.untouched) stage.goTo(orbit, false);
		else if (at.preset === 'ball' && (scene.ball ?? scene.best)) stage.follow(orbit);
	}, [scene, size.width, size.height]);
	const keys = useMemo(() => sceneKeys(() => stage, habits), [stage, habits]);
	useKeys(keys);

	return html`
		<div class="scene3d__stage" ref=${ref} data-ready=${ready}>
			<canvas ref=${canvas} role="img" tabindex="0" onMouseDown=${habits ? keepFocus : undefined} aria-label="The scene in 3D. The arrow keys turn it; plus moves closer and minus moves away. The table gives the same information in words."></canvas>
			${missing ? html`<p class="scene3d__missing" role="status">This browser shows no 3D graphics (WebGL 2). The table below says the same in words.</p>` : html`
				<div class="scene3d__labels" ref=${labels}>
					<svg class="scene3d__leaders" aria-hidden="true">${scene.stands.map(({ letter }) => html`<path key=${letter} data-leader=${letter} />`)}</svg>
					${scene.stands.map(({ letter, label }) => html`
						<button key=${letter} class="scene3d__camera letter" type="button" data-letter=${letter} data-label=${letter} data-sees=${scene.seen ? scene.seen.has(letter) : undefined} title=${`Look through ${label}`} aria-label=${`Look through camera ${letter}`} onClick=${() => lookThrough(letter)}>${letter}</button>`)}
					${scene.ball || scene.best ? html`<span class="scene3d__height" data-label="ball">${metres((scene.ball ?? scene.best)?.height)}</span>` : null}
				</div>`}
		</div>
	`;
}

/** Who turns the scene with the mouse keeps the keys of the page. @param {Event} event */
function keepFocus(event) {
	event.preventDefault();
}

/** @param {{hasBall: boolean}} props */
export function Presets({ hasBall }) {
	const at = standpoint.value;
	return html`
		${PRESETS.map(({ preset, label, key }) => {
			const off = preset === 'ball' && !hasBall;
			return html`
				<button
					key=${preset} class="button" type="button" aria-pressed=${at.kind === 'preset' && at.preset === preset}
					aria-disabled=${off} title=${off ? 'There is no 3D ball' : `${label} (${key})`}
					onClick=${() => { if (!off) goToPreset(preset); }}
				>${label} <kbd>${key}</kbd></button>`;
		})}
		<span class="scene3d__through">${at.kind === 'camera' ? `Through camera ${at.letter}` : ''}</span>
	`;
}

/** The frames of some views, by letter. @param {GroupDocument['views']} views @returns {Map<string, ImageBitmap>} */
export function useImages(views) {
	const frames = useFrames(views);
	return useMemo(() => new Map(views.flatMap(({ key, letter }) => {
		const frame = frames.get(key);
		return frame ? [[letter, frame]] : [];
	})), [frames]);
}

/** @param {{group: GroupDocument, solution: SolutionJson | null}} props */
export function ScenePanel({ group, solution }) {
	const scene = useMemo(() => sceneOf(group, solution), [group.id, group.views, solution]);
	const images = useImages(group.views);
	const hasBall = scene.ball !== null || scene.best !== null;
	return html`
		<${Stage} scene=${scene} images=${images} />
		<div class="scene3d__toolbar" role="toolbar" aria-label="Viewpoints">
			<${Presets} hasBall=${hasBall} />
			<button class="button" type="button" onClick=${toggleScene}>Images <kbd>\\</kbd></button>
		</div>
		<${SceneTable} scene=${scene} />
	`;
}
