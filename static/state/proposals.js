// @ts-check
/** Lines that are proposed for views of the group on screen; they count for nothing until accepted. */

import { batch, computed, effect, signal, untracked } from '@preact/signals';

import { proposeLines } from '../api/paint.js';
import { getGroupProposals } from '../api/proposals.js';
import { ApiError } from '../api/problem.js';
import { plural } from '../lib/format.js';
import { page } from '../lib/router.js';
import { group, groupDocument, submit } from './group.js';
import { announce, complain, explain } from './notice.js';
import { areNew, lookedAt, openProposals, settledState, stateOf, waitingViews, waitsForLines } from './proposal_lines.js';
import { focused, overlaysHidden } from './workspace.js';

/** @import {ViewProposalJson} from '../api/proposals.js' */
/** @import {ViewJson} from '../api/types.js' */

/** How long a group stands before it is asked about, ms. */
const PAUSE = 120;
const PAGES = ['review', 'calibration'];

/** What was looked for here and now; the server keeps nothing of it. */
const own = signal(/** @type {{group: number, items: ViewProposalJson[]}} */ ({ group: 0, items: [] }));
const answered = signal(/** @type {{group: number, items: ViewProposalJson[]} | null} */ (null));

/** What is proposed for views of the group on screen that have no camera, by key of the view. */
export const proposals = computed(() => {
	const [at, saved] = [group.value, groupDocument.value];
	if (!at || !saved) return new Map();
	const known = [answered.value, own.value].flatMap((one) => (one?.group === at.id ? one.items : []));
	const waiting = new Map(at.views.filter((view) => waitsForLines(view, saved.solution)).map((view) => [view.id, view.lines]));
	const items = known.filter(({ open, view, lines }) => open && waiting.has(view) && areNew(waiting.get(view) ?? {}, lines));
	return new Map(/** @type {[string, ViewProposalJson][]} */ (items.map((item) => [item.key, item])));
});

/** @type {ReturnType<typeof setTimeout> | undefined} */
let timer;
let controller = new AbortController();

/** Ask about groups with views without a camera, for as long as a page shows them. @returns {() => void} */
export function followProposals() {
	// Which proposals are open depends on the lines: every state is asked about.
	const wanted = computed(() => {
		const at = groupDocument.value;
		return at && PAGES.includes(page.value.page) && waitingViews(at).length > 0 ? stateOf(at) : null;
	});
	const stop = effect(() => {
		const state = wanted.value;
		untracked(() => {
			leave();
			if (state !== null) timer = setTimeout(ask, PAUSE, state, controller.signal);
		});
	});
	const show = effect(() => { openProposals.value = proposals.value; });
	return () => { stop(); show(); leave(); openProposals.value = new Map(); };
}

function leave() {
	clearTimeout(timer);
	controller.abort();
	controller = new AbortController();
}

/** @param {string} state @param {AbortSignal} abort */
async function ask(state, abort) {
	const id = parseInt(state, 10);
	try {
		const { items } = await getGroupProposals(id, abort);
		if (abort.aborted) return;
		batch(() => {
			answered.value = { group: id, items };
			settledState.value = state;
		});
	} catch (error) {
		// The server is away, or another group came: the group can be worked on without.
		if (abort.aborted) return;
		settledState.value = state;
		if (!(error instanceof ApiError)) throw error;
	}
}

/** Why there is no proposal for a view. @param {ViewJson} view */
function whyNone(view) {
	if (!waitsForLines(view, groupDocument.value?.solution ?? null)) return `View ${view.letter} already has a camera.`;
	const looked = `No lines are proposed for view ${view.letter} yet. “Propose lines” on the result card searches this picture; “Propose lines” on the Statistics page searches all pictures.`;
	return view.station.shared ? `${looked} For a static camera, the proposal is shown at the first view with a picture, perhaps in another group.` : looked;
}

/** Look at the picture of a view for lines; what is found is shown as proposed. @param {ViewJson} view */
export async function proposeNow(view) {
	const id = group.peek()?.id;
	if (id === undefined || lookedAt.peek().has(view.id)) return;
	lookedAt.value = new Set([...lookedAt.peek(), view.id]);
	announce(`Searching the picture of view ${view.letter} for lines…`);
	try {
		const found = await proposeLines(view.id, {});
		const before = own.peek().group === id ? own.peek().items : [];
		own.value = { group: id, items: [...before.filter((item) => item.view !== view.id), { ...found, view: view.id, key: view.key, open: true }] };
		if (found.outcome !== 'proposed') complain(`No lines are proposed for view ${view.letter}. ${found.sentence}`);
		else announce(`${plural(Object.keys(found.lines).length, 'marking')} proposed for view ${view.letter}.`);
	} catch (error) {
		if (!(error instanceof ApiError)) throw error;
		complain(`View ${view.letter}: ${error.message}`);
	} finally {
		lookedAt.value = new Set([...lookedAt.peek()].filter((one) => one !== view.id));
	}
}

/** Add the proposed lines of a view to its lines. @param {ViewJson} view */
export function acceptProposal(view) {
	const item = proposals.peek().get(view.key);
	if (!item) explain(whyNone(view));
	else if (item.outcome !== 'proposed') complain(`No lines are proposed for view ${view.letter}. ${item.sentence}`);
	else if (overlaysHidden.value) complain('The proposed lines are hidden. Press H to see what you would accept.');
	else {
		const names = Object.keys(item.lines);
		submit({ kind: 'lines', view: view.key, lines: item.lines, proposed: names });
		const drawn = Object.keys(view.lines).length;
		const beside = drawn ? `; the ${plural(drawn, 'marking')} drawn before ${drawn === 1 ? 'is' : 'are'} kept` : '';
		announce(`${plural(names.length, 'marking')} of view ${view.letter} accepted as proposed${beside}. Undo removes the proposed lines; M swaps left and right.`);
	}
}

/** Accept what is proposed for the view in hand. */
export function acceptFocused() {
	const view = group.value?.views.find(({ letter }) => letter === focused.value);
	if (view) acceptProposal(view);
}
