// @ts-check
/** How far the review is. */

import { html } from 'htm/preact';

import { count } from '../lib/format.js';
import { summary } from '../state/queue.js';

/** @import {DatasetJson} from '../api/types.js' */

const STATES = /** @type {const} */ (['accepted', 'rejected', 'deferred']);

/** @typedef {Pick<DatasetJson, 'groups' | 'solved' | 'accepted' | 'rejected' | 'deferred'>} Progress */

/** The bar and its words. @param {{progress: Progress}} props */
export function ProgressLine({ progress }) {
	const done = progress.accepted + progress.rejected;
	const unsolved = progress.groups - progress.solved;
	return html`
		<div>
			<div class="progress-bar" role="img" aria-label=${`${done} of ${progress.groups} groups reviewed`}>
				${STATES.map((state) => html`
					<span key=${state} data-status=${state} style=${{ width: `${(100 * progress[state]) / Math.max(1, progress.groups)}%` }}></span>`)}
			</div>
			<p class="note">
				${count(progress.accepted)} accepted · ${count(progress.rejected)} rejected · ${count(progress.deferred)} deferred
				${unsolved > 0 ? html`<br /><span data-grade="warn">${count(unsolved)} not solved yet</span>` : null}
			</p>
		</div>
	`;
}

/** @param {{dataset: DatasetJson}} props */
export function ProgressCard({ dataset }) {
	const progress = summary.value?.progress ?? dataset;
	const done = progress.accepted + progress.rejected;
	return html`
		<section class="card progress-card" aria-label="Progress">
			<h2>Reviewed <strong>${count(done)}</strong> of ${count(progress.groups)}</h2>
			<${ProgressLine} progress=${progress} />
		</section>
	`;
}
