// @ts-check
/** Parts of the page of work: how far a batch is, when it is due. */

import { html } from 'htm/preact';

import { isOverHere } from '../../lib/day.js';
import { count, plural } from '../../lib/format.js';

/** @import {BatchJson} from '../../api/work.js' */

/** How far a batch is, in words and as a bar. @param {{batch: BatchJson}} props */
export function Progress({ batch }) {
	const { groups, settled, submitted: handed } = batch;
	const words = [`${count(settled)} of ${plural(groups, batch.kind === 'tracks' ? 'track' : 'group')} done`, handed && batch.annotators.length && batch.verdicts === 1 ? `${count(handed)} submitted` : '', `${count(batch.waiting)} open`];
	/** @param {number} n */
	const share = (n) => (groups ? (100 * n) / groups : 0);
	return html`
		<svg class="work__bar" viewBox="0 0 100 4" preserveAspectRatio="none" aria-hidden="true">
			<rect class="work__done" width=${share(settled)} height="4" />
			<rect class="work__handed" x=${share(settled)} width=${share(handed)} height="4" />
		</svg>
		<span class="note">${words.filter(Boolean).join(' · ')}</span>
	`;
}

/** @param {{due: string | null}} props */
export function Due({ due }) {
	if (!due) return null;
	const late = isOverHere(due);
	const day = new Date(`${due}T00:00`).toLocaleDateString('en-GB', { day: 'numeric', month: 'short', year: 'numeric' });
	return html` · <span class="work__due" data-grade=${late ? 'bad' : undefined}>${late ? `was due ${day}` : `due ${day}`}</span>`;
}
