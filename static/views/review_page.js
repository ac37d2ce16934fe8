// @ts-check
/** The review screen: one group, every number beside its pixels. */

import { html } from 'htm/preact';
import { useEffect, useMemo, useRef } from 'preact/hooks';

import { useKeys } from '../lib/hooks.js';
import { lazy } from '../lib/lazy.js';
import { withOtherBall } from '../geometry/estimator.js';
import { picturesOf } from '../overlays/scene.js';
import { absent, mayReturn, retry } from '../state/arrival.js';
import { conflict } from '../state/conflict.js';
import { group, groupDocument, isPreview, solution } from '../state/group.js';
import { question } from '../state/return_group.js';
import { sceneShown } from '../state/scene3d.js';
import { guidelinesShown, isCopy } from '../state/independent_annotations.js';
import { threads, withThreads } from '../state/threads.js';
import { estimator, focused, loupe, maximised } from '../state/workspace.js';
import { NoticeBar } from './bars.js';
import { useFollowed } from './follow_parts.js';
import { ImageGrid, ReviewMain } from './image_grid.js';
import { usePredictions, withPredictions } from './prediction_parts.js';
import { useProposals } from './proposal_parts.js';
import { LeaseBar } from './lease_bar.js';
import { Rail } from './rail.js';
import { ReviewHeader } from './review_header.js';
import { REVIEW_KEYS } from './review_keys.js';
import { Scene3D } from './scene3d/scene3d.js';
import { BottomStrip } from './strip.js';
import { UndecidedBar } from './undecided_bar.js';
import { usePaint } from './view_paint.js';

const ConflictBar = lazy(async () => (await import('./conflict_bar.js')).ConflictBar);
const Guidelines = lazy(async () => (await import('./guidelines.js')).Guidelines);
const ReturnDialog = lazy(async () => (await import('./return_dialog.js')).ReturnDialog);
const IndependentAnnotationBar = lazy(async () => (await import('./independent_annotation_bar.js')).IndependentAnnotationBar);
const Loupe = lazy(async () => (await import('./loupe.js')).Loupe);

/** What is focused or shown alone must exist in this group; before there is one, nothing is known. @param {string[]} letters */
function keepWithin(letters) {
	if (letters.length === 0) return;
	if (!letters.includes(focused.value)) focused.value = letters[0];
	if (maximised.value && !letters.includes(maximised.value)) maximised.value = null;
}

/** In the place of a group that is not there, or not yet. */
function Absent() {
	if (absent.value === 0) return html`<main class="review__empty" aria-busy="true"><p>Loading…</p></main>`;
	return html`
		<main class="review__empty">
			<h1>Group ${absent.value} cannot be shown</h1>
			<p>${mayReturn.value && html`<button type="button" onClick=${retry}>Try again</button> `}<a href="/groups">Open the queue</a></p>
		</main>
	`;
}

function Workspace() {
	const shown = group.value;
	const live = isPreview.value;
	const other = estimator.value === 'other' && !live;
	const found = solution.value;
	// While something moves the browser computes the mean of pairs and nothing else.
	const solved = useMemo(() => (other && shown && found ? withOtherBall(shown, found) : found), [other, shown, found]);
	const saved = groupDocument.value;
	const plain = useMemo(() => (shown ? picturesOf(shown, solved, saved) : []), [shown, solved, saved]);
	const predicted = usePredictions(shown !== null);
	const marked = useMemo(() => withPredictions(plain, predicted), [plain, predicted]);
	const drawn = useFollowed(useProposals(usePaint(marked, saved), saved));
	const said = threads.value;
	const pictures = useMemo(() => withThreads(drawn, said), [drawn, said]);
	useEffect(() => keepWithin(pictures.map(({ view }) => view.letter)), [pictures]);
	if (!shown) return html`<${Absent} />`;
	return html`
		<${ReviewMain} pictures=${pictures}>
			${sceneShown.value ? html`<${Scene3D} group=${shown} solution=${found} />` : html`<${ImageGrid} pictures=${pictures} />`}
			<p class="small-note">Look, comment and decide here. To draw or move points and balls, open the group on a wider screen or in a wider window.</p>
			<${BottomStrip} group=${shown} solution=${solved} pictures=${pictures} />
		<//>
		<${Rail} group=${shown} solution=${solved} pictures=${pictures} live=${live} />
		${loupe.value ? html`<${Loupe} pictures=${pictures} />` : null}
	`;
}

export function ReviewPage() {
	const root = useRef(/** @type {HTMLDivElement | null} */ (null));
	useKeys(REVIEW_KEYS);
	// On a small screen the page scrolls: the next group begins at its pictures.
	useEffect(() => root.current?.scrollTo(0, 0), [group.value?.id]);
	useEffect(() => {
		document.title = group.value ? `${group.value.label} · Touchline` : 'Touchline';
	}, [group.value?.label]);
	return html`
		<div class="review" ref=${root}>
			<${ReviewHeader} />
			<div class="bars">${isCopy(groupDocument.value) ? html`<${IndependentAnnotationBar} />` : null}<${NoticeBar} /><${LeaseBar} /><${UndecidedBar} />${conflict.value ? html`<${ConflictBar} />` : null}</div>
			<${Workspace} />
			${question.value ? html`<${ReturnDialog} />` : null}
			${guidelinesShown.value ? html`<${Guidelines} />` : null}
		</div>
	`;
}
