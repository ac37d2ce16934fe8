// @ts-check
/** The marking in hand and what can be done with it; what is staged; the way to save it. */

import { html } from 'htm/preact';

import { fixed, pixelText } from '../../lib/format.js';
import { explain } from '../../state/notice.js';
import { asking, isWaiting, proposeFromPaint, snapToPaint } from '../../state/paint.js';
import { changed, changes, choice, discardStaged, lines, mode, redo, staging, undo } from '../../state/calibration.js';
import { redoable, undoable } from '../../state/undo.js';
import { deleteChosen, deleteMarking, insertPoint, save, swapAllSides, toggleDrawing, toggleRelabelling } from './actions.js';

/** @import {ViewPicture} from '../../overlays/scene.js' */

/** @param {{label: string, keys: string, run: () => void, off?: string | null, pressed?: boolean}} props `off`: why it cannot be done now */
function Action({ label, keys, run, off = null, pressed }) {
	return html`
		<button
			class="button" type="button" aria-disabled=${off !== null} aria-pressed=${pressed}
			title=${off ?? `${label} (${keys})`} onClick=${() => { if (off === null) run(); else explain(`${off}.`); }}
		>${label} <kbd>${keys}</kbd></button>
	`;
}

/** @param {{picture: ViewPicture}} props */
function Points({ picture }) {
	const chosen = choice.value;
	const points = chosen ? (lines.value[chosen.marking] ?? []) : [];
	if (!chosen || points.length === 0) return null;
	const fit = picture.markings.find(({ marking }) => marking === chosen.marking);
	return html`
		<ol class="points" aria-label=${`Points of ${chosen.marking}`}>
			${points.map(({ x, y }, i) => html`
				<li key=${i}>
					<button type="button" aria-pressed=${chosen.index === i} onClick=${() => { choice.value = { marking: chosen.marking, index: i }; }}>
						<span>${i + 1}</span><span>${fixed(x, 1)}</span><span>${fixed(y, 1)}</span>
						<span>${fit?.points[i]?.distance === undefined ? '' : pixelText(fit.points[i].distance)}</span>
					</button>
				</li>`)}
		</ol>
	`;
}

/** @param {{picture: ViewPicture}} props */
export function MarkingCard({ picture }) {
	const chosen = choice.value;
	const there = Boolean(chosen && lines.value[chosen.marking]);
	const lined = Object.keys(lines.value).length > 0;
	const proposed = picture.proposal?.item.outcome === 'proposed';
	const frameless = picture.view.image ? null : 'This view has no frame';
	const busy = asking.value ? 'The frame is being read' : null;
	const none = chosen ? null : 'Choose a marking first';
	const absent = there ? null : chosen ? 'This marking has no points yet' : 'Choose a marking first';
	return html`
		<section class="card marking-card" aria-label="Chosen marking">
			<h2>${chosen?.marking ?? 'No marking chosen'}</h2>
			<div class="marking-card__actions">
				<${Action} label=${mode.value === 'draw' ? 'Done' : 'Draw'} keys="N" run=${toggleDrawing} off=${none} pressed=${mode.value === 'draw'} />
				<${Action} label="Insert" keys="I" run=${insertPoint} off=${none} />
				<${Action} label="Relabel" keys="R" run=${toggleRelabelling} off=${absent} pressed=${mode.value === 'relabel'} />
				<${Action} label=${chosen?.index === null || !chosen ? 'Delete' : 'Delete point'} keys="Del" run=${deleteChosen} off=${absent} />
				${chosen && chosen.index !== null ? html`<${Action} label="Delete marking" keys="⇧ Del" run=${deleteMarking} off=${absent} />` : null}
				<${Action} label="Swap sides" keys="M" run=${swapAllSides} off=${lined ? null : 'There are no lines'} />
				${isWaiting.value
					? html`<${Action} label=${asking.value ? 'Looking…' : 'Propose lines'} keys="⇧ P" run=${() => { proposeFromPaint(); }} off=${frameless ?? busy} />`
					: html`<${Action} label=${asking.value ? 'Reading…' : 'Snap to paint'} keys="K" run=${() => { snapToPaint(); }} off=${frameless ?? busy} />`}
			</div>
			${chosen ? null : html`<p class="note">${proposed ? 'The violet dashed lines are proposed: ⇧ P stages them.' : lined ? 'Click a line in the diagram, in the table or on the picture.' : 'Click a line in the diagram to draw it, or have lines proposed from the paint.'}</p>`}
			<${Points} picture=${picture} />
		</section>
	`;
}

/** @param {{shared: boolean}} props */
export function CommitBar({ shared }) {
	const { steps, at } = staging.value;
	const markings = Object.keys(changes.value).length;
	const off = changed.value ? null : 'Nothing is staged';
	return html`
		<section class="commit" aria-label="Staged changes">
			<p class="commit__state" role="status">
				${markings ? html`<strong>${markings} ${markings === 1 ? 'marking' : 'markings'} staged</strong> <span>${steps[at - 1]?.label ?? ''}</span>` : 'Nothing is staged.'}
			</p>
			<div class="commit__buttons">
				<${Action} label="Undo" keys="Ctrl Z" run=${undo} off=${at > 0 || undoable.value ? null : 'Nothing to undo'} />
				<${Action} label="Redo" keys="Ctrl ⇧ Z" run=${redo} off=${at < steps.length || redoable.value ? null : 'Nothing to redo'} />
				<${Action} label="Discard" keys="Ctrl Del" run=${discardStaged} off=${off} />
				<button data-needs="annotate" class="button button--primary" type="button" aria-disabled=${off !== null} title=${off ?? 'Save everything staged as one edit (Ctrl S)'} onClick=${() => { if (off === null) save(); else explain(`${off}.`); }}>
					${shared ? 'Save for all its views' : 'Save'} <kbd>Ctrl S</kbd>
				</button>
			</div>
		</section>
	`;
}
