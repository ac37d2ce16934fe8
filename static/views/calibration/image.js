// @ts-check
/** The view in hand, large: its frame, its lines, the camera before and after. */

import { html } from 'htm/preact';
import { useEffect, useMemo, useRef } from 'preact/hooks';

import { plural } from '../../lib/format.js';
import { useSize } from '../../lib/hooks.js';
import Konva from '../../lib/konva.js';
import { ImageStage } from '../../overlays/stage.js';
import { changed, choice, hovered, lines, mode } from '../../state/calibration.js';
import { conflict } from '../../state/conflict.js';
import { paint, paintShown } from '../../state/paint.js';
import { fitPanel, panPanel, viewportOf, zoomPanel } from '../../state/viewports.js';
import { gain, overlaysHidden, projections } from '../../state/workspace.js';
import { useFrame } from '../frame.js';
import { PanelCaption } from '../panel_caption.js';
import { ProposalScores, outcomeWords } from '../proposal_card.js';
import { drawEditorMarks } from './marks.js';
import { PaintChip } from './paint_chip.js';
import { panelKey } from './panel_key.js';
import { attachEditor } from './pointer.js';

/** @import {CalibrationJson} from '../../api/types.js' */
/** @import {ViewPicture} from '../../overlays/scene.js' */
/** @import {EditorMarks} from './marks.js' */

/** The stage of the review screen with the editor's marks on top. */
class EditorStage extends ImageStage {
	/** @param {HTMLDivElement} container */
	constructor(container) {
		super(container);
		/** @type {EditorMarks | null} */
		this.marks = null;
		this.above.add(new Konva.Shape({
			listening: false,
			sceneFunc: (context) => {
				if (this.marks && !this.scene?.hidden) drawEditorMarks(context._context, this.marks);
			},
		}));
	}
}

/** What was proposed for the view, over its picture. @param {{item: import('../../api/proposals.js').ViewProposalJson}} props */
function ProposalChip({ item }) {
	const found = item.outcome === 'proposed';
	return html`
		<div class="paint-chip proposal-chip" role="status" data-outcome=${item.outcome}>
			<p>${found ? `${plural(Object.keys(item.lines).length, 'marking')} proposed. ${item.sentence}` : `Searched before: ${outcomeWords(item)}. ${item.sentence}`}</p>
			<${ProposalScores} item=${item} />
		</div>
	`;
}

/** @param {{picture: ViewPicture, before: CalibrationJson | null}} props */
export function EditorImage({ picture, before }) {
	const { view } = picture;
	const [ref, size] = useSize();
	const stage = useRef(/** @type {EditorStage | null} */ (null));
	const { image } = useFrame(view.image);
	const key = panelKey(view.letter);
	const viewport = viewportOf(key, view, size);
	const now = useRef({ view, size, viewport, picture });
	now.current = { view, size, viewport, picture };

	useEffect(() => {
		const element = /** @type {HTMLDivElement} */ (ref.current);
		const made = new EditorStage(element);
		stage.current = made;
		const detach = attachEditor(element, {
			viewport: () => now.current.viewport,
			fits: () => now.current.picture.markings,
			size: () => now.current.view,
			pan: (dx, dy) => {
				const { view: v, size: s } = now.current;
				panPanel(panelKey(v.letter), v, s, dx, dy);
			},
			zoom: (at, factor) => {
				const { view: v, size: s } = now.current;
				zoomPanel(panelKey(v.letter), v, s, at, factor);
			},
		});
		return () => { detach(); made.destroy(); };
	}, []);
	useEffect(() => () => fitPanel(key), [key]);
	useEffect(() => stage.current?.show(image), [image]);

	const chosen = choice.value;
	const seen = paintShown.value ? paint.value : null;
	const saved = useMemo(() => (
		changed.value ? (before?.markings ?? []).map(({ polyline }) => polyline.map(([x, y]) => ({ x, y }))) : []
	), [changed.value, before]);
	useEffect(() => {
		const drawn = stage.current;
		if (size.width === 0 || !drawn) return;
		drawn.resize(size.width, size.height);
		drawn.marks = {
			viewport, size: view, lines: lines.value, fits: picture.markings, saved, choice: chosen, hovered: hovered.value,
			paint: seen,
		};
		drawn.draw({
			picture, viewport, hidden: overlaysHidden.value, projections: projections.value, boxes: false,
			gain: gain.value, rays: false, ghosts: conflict.value?.fields,
			selected: chosen && { kind: 'point', view: view.key, marking: chosen.marking, index: chosen.index ?? -1 },
		});
	}, [
		picture, viewport.scale, viewport.left, viewport.top, size.width, size.height, saved, chosen, hovered.value,
		overlaysHidden.value, projections.value, gain.value, seen, conflict.value,
	]);

	const drawing = mode.value === 'draw' && chosen;
	return html`
		<figure class="image-panel editor__panel" data-view=${view.letter} data-focused="true" tabindex="0" aria-label=${`View ${view.letter}, ${view.label}`}>
			<div class="image-panel__stage" data-ready=${Boolean(image)} data-mode=${mode.value} ref=${ref}></div>
			${view.image ? null : html`<p class="image-panel__missing">No frame · the lines can be edited</p>`}
			<${PanelCaption} picture=${picture} frame=${image} />
			<${PaintChip} />
			${picture.proposal && !paintShown.value ? html`<${ProposalChip} item=${picture.proposal.item} />` : null}
			${drawing ? html`<p class="editor__hint" role="status">Click to set points on <strong>${chosen.marking}</strong> · Esc when done</p>` : null}
		</figure>
	`;
}
