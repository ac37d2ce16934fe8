// @ts-check
/** What is proposed for the views without a camera, with its scores, and the way to accept it. */

import { html } from 'htm/preact';

import { fixed, plural, sharePercent } from '../lib/format.js';
import { acceptProposal } from '../state/proposals.js';
import { focusView } from '../state/workspace.js';
import { Letter } from './letter.js';
import { Term } from './term.js';

/** @import {ViewProposalJson} from '../api/proposals.js' */
/** @import {ViewPicture} from '../overlays/scene.js' */

/** What a search for lines in a picture found. @param {Pick<ViewProposalJson, 'outcome'>} item */
export function outcomeWords({ outcome }) {
	return outcome === 'nothing' ? 'nothing found' : outcome;
}

/** The scores of a proposal in a line. @param {{item: ViewProposalJson}} props */
export function ProposalScores({ item }) {
	const { supported, explained, error_px: error, runner_up: lead } = item;
	const parts = [
		supported === null ? null : html`<${Term} word="supported">supported<//> ${sharePercent(supported)}`,
		explained === null ? null : html`<${Term} word="explained">explained<//> ${sharePercent(explained)}`,
		error === null ? null : html`${fixed(error, 2)} px off`,
		lead === null ? null : html`second-best camera scores ${fixed(lead, 2)} less`,
	].filter((part) => part !== null);
	return html`<span class="proposals__scores">${parts.map((part, i) => html`<span key=${i}>${part}</span>`)}</span>`;
}

/** @param {{picture: ViewPicture, item: ViewProposalJson}} props */
function Row({ picture: { view }, item }) {
	const why = item.sentence;
	return html`
		<li data-proposal=${view.letter} data-outcome=${item.outcome}>
			<button class="row-button" type="button" title=${`Show ${view.label}`} aria-label=${`Show the proposal for view ${view.letter}`} onClick=${() => focusView(view.letter)}><${Letter} letter=${view.letter} /></button>
			<span class="proposals__what">
				<strong>${item.outcome === 'proposed' ? `${plural(Object.keys(item.lines).length, 'marking')} proposed` : outcomeWords(item)}</strong>
				${why ? html`<span>${why}</span>` : null}
				<${ProposalScores} item=${item} />
			</span>
			${item.outcome === 'proposed' ? html`
				<button data-needs="annotate" class="button button--small" type="button" title="Add them to the lines of this view (Shift+P)" aria-label=${`Accept the lines proposed for view ${view.letter}`} onClick=${() => acceptProposal(view)}>Accept</button>` : null}
		</li>
	`;
}

/** @param {{pictures: ViewPicture[]}} props */
export function ProposalCard({ pictures }) {
	return html`
		<section class="card proposals" aria-label="Proposed lines">
			<h2 title="Lines that Touchline found in the picture: violet and dashed. They are not used until a person accepts them."><${Term} word="proposal">Proposed lines<//></h2>
			<ul class="proposals__views">
				${pictures.map((picture) => (picture.proposal ? html`<${Row} key=${picture.view.key} picture=${picture} item=${picture.proposal.item} />` : null))}
			</ul>
		</section>
	`;
}
