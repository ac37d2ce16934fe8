// @ts-check
/** The calibration editor: one view of a group, its lines, its camera, before and after. */

import { html } from 'htm/preact';
import { useCallback, useEffect, useMemo, useState } from 'preact/hooks';

import { getInfluence, getStation } from '../../api/calibration.js';
import { ApiError } from '../../api/problem.js';
import { useKeys } from '../../lib/hooks.js';
import { useResource } from '../../lib/resource.js';
import { address, navigate, page, param } from '../../lib/router.js';
import { picturesOf } from '../../overlays/scene.js';
import {
	changed, resetForView, shown, shownSolution, startAsking, view,
} from '../../state/calibration.js';
import { editorAddress } from '../../state/editor_address.js';
import { groupDocument, open, pending } from '../../state/group.js';
import { queueAddress, reviewAddress } from '../../state/navigation.js';
import { complain } from '../../state/notice.js';
import { followPaint } from '../../state/paint.js';
import { proposalDrawing } from '../../overlays/proposal.js';
import { followProposals, proposals } from '../../state/proposals.js';
import { watchSolving } from '../../state/solving.js';
import { NoticeBar } from '../bars.js';
import { ConflictBar } from '../conflict_bar.js';
import { Header } from '../header.js';
import { Letter } from '../letter.js';
import { SaveState } from '../save_state.js';
import { CameraCard } from './camera_card.js';
import { Comparison } from './comparison.js';
import { PitchDiagram } from './diagram.js';
import { EditorImage } from './image.js';
import { EDITOR_KEYS } from './keys.js';
import { LineTable } from './line_table.js';
import { CommitBar, MarkingCard } from './staged_card.js';
import { StationCard } from './station_card.js';

/** @import {GroupDocument, ViewJson} from '../../api/types.js' */

/** @param {number} id @param {(id: number) => void} setAbsent */
async function enter(id, setAbsent) {
	setAbsent(0);
	try {
		await open(id);
	} catch (error) {
		if (!(error instanceof ApiError)) throw error;
		const at = page.peek();
		if (at.page !== 'calibration' || at.group !== id) return;
		setAbsent(id);
		complain(`Group ${id} cannot be shown: ${error.message}`, { label: 'Open the queue', run: () => navigate('/groups') });
	}
}

/** In the place of a group that is not there, or not yet. @param {{id: number}} props `id`: 0 while it may come */
function Absent({ id }) {
	if (id === 0) return html`<main class="review__empty" aria-busy="true"><p>Loading…</p></main>`;
	return html`
		<main class="review__empty">
			<h1>Group ${id} cannot be shown</h1>
			<p><a href="/groups">Open the queue</a></p>
		</main>
	`;
}

/** @param {{group: GroupDocument, current: string}} props */
function ViewTabs({ group, current }) {
	return html`
		<nav class="header__middle editor__views" aria-label="Views of the group">
			<a class="button" href=${reviewAddress(group.id)} title="Back to the review (Esc)">‹ Review</a>
			${param('recording') ? html`<a class="button" href=${address(`/recordings/${param('recording')}`, { frame: param('frame') })} title="Back to the frame of the recording">‹ Recording</a>` : null}
			${group.views.map((one) => html`
				<a
					key=${one.key} class="editor__tab" href=${editorAddress(group.id, one.key)} title=${one.label}
					aria-current=${one.key === current ? 'true' : undefined}
				><${Letter} letter=${one.letter} /><span class="editor__tab-name">${one.label}</span></a>`)}
			<a class="editor__where" href=${queueAddress(group.dataset.name, '')} title=${group.key}>${group.label}</a>
		</nav>
	`;
}

/** A camera that many groups share is solved anew in all of them once an edit is saved. @param {ViewJson} at @param {string} dataset */
function useSolvingWatch(at, dataset) {
	const sending = pending.value.some(({ kind, view: key }) => kind === 'lines' && key === at.key);
	useEffect(() => {
		if (!at.station.shared || !sending) return undefined;
		return () => { watchSolving(dataset); };
	}, [sending, at.station.id]);
}

const TALL = matchMedia('(min-height: 860px)');

/** Whether the rail has room for the comparison too. */
function useTall() {
	const [tall, setTall] = useState(TALL.matches);
	useEffect(() => {
		const hear = () => setTall(TALL.matches);
		TALL.addEventListener('change', hear);
		return () => TALL.removeEventListener('change', hear);
	}, []);
	return tall;
}

/** @param {{group: GroupDocument, at: ViewJson}} props */
function Workspace({ group, at }) {
	const after = shownSolution.value;
	const saved = groupDocument.value;
	const before = saved?.solution ?? null;
	const plain = useMemo(() => picturesOf(group, after, saved).find(({ view: { key } }) => key === at.key), [group, after, saved, at.key]);
	const item = changed.value ? undefined : proposals.value.get(at.key);
	const picture = useMemo(() => (plain && item ? { ...plain, proposal: { item, draw: proposalDrawing(item.lines) } } : plain), [plain, item]);
	const solved = before?.views.find((one) => one.view === at.key)?.calibration ?? null;
	const readInfluence = useCallback((/** @type {AbortSignal} */ signal) => getInfluence(at.id, signal), [at.id]);
	const influence = useResource(readInfluence, [at.id, saved?.etag]);
	const readStation = useCallback((/** @type {AbortSignal} */ signal) => (
		at.station.shared ? getStation(at.station.id, signal) : Promise.resolve(null)
	), [at.station.id]);
	const station = useResource(readStation, [at.station.id, saved?.etag]);
	useSolvingWatch(at, group.dataset.name);
	useEffect(() => resetForView, [at.station.id]);
	const tall = useTall();
	if (!picture) return null;
	const comparison = html`<${Comparison} group=${group} view=${at.key} before=${before} after=${after} />`;
	return html`
		<main class="editor__main">
			<h1 class="hidden-text">Calibration of ${at.label}</h1>
			<${EditorImage} key=${at.letter} picture=${picture} before=${solved} />
			<div class="editor__strip" data-cards=${tall ? 2 : 3}>
				<${LineTable} picture=${picture} influences=${influence.value} />
				${tall ? null : comparison}
				<${CameraCard} picture=${picture} solution=${after} />
			</div>
		</main>
		<aside class="editor__rail" aria-label="Markings and staged changes">
			<${PitchDiagram} pitch=${group.pitch} fits=${picture.markings} />
			<${StationCard} view=${at} station=${station.value} dataset=${group.dataset} />
			<${MarkingCard} picture=${picture} />
			${tall ? comparison : null}
			<${CommitBar} shared=${at.station.shared} />
		</aside>
	`;
}

export function CalibrationPage() {
	useKeys(EDITOR_KEYS);
	const wanted = page.value.page === 'calibration' ? page.value.group : null;
	const [absent, setAbsent] = useState(0);
	useEffect(() => { if (wanted !== null) enter(wanted, setAbsent); }, [wanted]);
	useEffect(() => startAsking(), []);
	useEffect(() => followPaint(), []);
	useEffect(() => followProposals(), []);
	useEffect(() => {
		/** @param {BeforeUnloadEvent} event */
		const ask = (event) => { if (changed.value) event.preventDefault(); };
		addEventListener('beforeunload', ask);
		return () => removeEventListener('beforeunload', ask);
	}, []);
	const group = shown.value?.id === wanted ? shown.value : null;
	const at = view.value;
	useEffect(() => {
		document.title = at ? `Calibration of ${at.label} · Touchline` : 'Touchline';
	}, [at?.label]);
	return html`
		<div class="editor">
			<${Header} current="calibration">
				${group && at ? html`<${ViewTabs} group=${group} current=${at.key} />` : html`<span class="header__middle"></span>`}
				<${SaveState} />
			<//>
			<div class="bars"><${NoticeBar} /><${ConflictBar} /></div>
			<p class="small-note">The calibration editor needs a wider screen or window. ${wanted === null ? null : html`<a class="button" href=${reviewAddress(wanted)}>Back to the review</a>`}</p>
			${group && at ? html`<${Workspace} group=${group} at=${at} />` : html`<${Absent} id=${absent === wanted ? absent : 0} />`}
		</div>
	`;
}
