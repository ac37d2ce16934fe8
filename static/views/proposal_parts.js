// @ts-check
/** The way to proposals: what only groups with views without a camera need is fetched when one is met. */

import { signal } from '@preact/signals';
import { useEffect, useMemo } from 'preact/hooks';

import { lazy } from '../lib/lazy.js';
import { explain } from '../state/notice.js';
import { settledState, stateOf, waitingViews } from '../state/proposal_lines.js';

/** @import {ViewProposalJson} from '../api/proposals.js' */
/** @import {GroupDocument} from '../api/types.js' */
/** @import {ViewPicture} from '../overlays/scene.js' */

/** @typedef {typeof import('../state/proposals.js') & typeof import('../overlays/proposal.js')} Loaded */

const loaded = signal(/** @type {Loaded | null} */ (null));
/** @type {Map<string, ViewProposalJson>} */
const NONE = new Map();

export const ProposalCard = lazy(async () => (await import('./proposal_card.js')).ProposalCard);

/**
 * The pictures with what is proposed for them, where they have no camera.
 *
 * @param {ViewPicture[]} pictures @param {GroupDocument | null} saved
 * @returns {ViewPicture[]}
 */
export function useProposals(pictures, saved) {
	const wanted = saved !== null && waitingViews(saved).length > 0 ? stateOf(saved) : '';
	useEffect(() => { if (wanted) load(wanted); }, [wanted]);
	const parts = loaded.value;
	useEffect(() => parts?.followProposals(), [parts]);
	const known = parts?.proposals.value ?? NONE;
	return useMemo(() => (
		known.size === 0 || !parts ? pictures : pictures.map((picture) => withProposal(picture, known.get(picture.view.key), parts))
	), [pictures, known, parts]);
}

/** @param {ViewPicture} picture @param {ViewProposalJson | undefined} item @param {Loaded} parts @returns {ViewPicture} */
function withProposal(picture, item, { proposalDrawing }) {
	return item ? { ...picture, proposal: { item, draw: proposalDrawing(item.lines) } } : picture;
}

/** @param {string} state */
function load(state) {
	if (loaded.value) return;
	// The server may be away: the next state of a group with such a view tries again.
	Promise.all([import('../state/proposals.js'), import('../overlays/proposal.js')]).then(
		([state, drawing]) => { loaded.value = { ...state, ...drawing }; },
		() => { settledState.value = state; },
	);
}

/** Accept what is proposed for the view in hand. */
export function acceptProposed() {
	if (loaded.value) loaded.value.acceptFocused();
	else explain('Lines are proposed for views without a camera: every view here has one.');
}
