// @ts-check
/** Where there is no dataset to show: what to do about it, by what the person may do. */

import { html } from 'htm/preact';

import { isTeam } from '../state/me.js';
import { whyNot } from '../state/rights.js';

/** Whether somebody may import, into a dataset or (without a name) into a new one. @param {string} [dataset] */
export function mayImport(dataset) {
	return whyNot('lead', dataset) === '';
}

export function NoDatasets() {
	if (isTeam && !mayImport()) {
		return html`
			<section class="card empty">
				<h2>No dataset that you may see</h2>
				<p>Ask a lead or an admin for a role in a dataset. It then appears here.</p>
			</section>
		`;
	}
	return html`
		<section class="card empty">
			<h2>No dataset yet</h2>
			<p>Import your own files, or add a video of a match on the page Recordings. To try it out, open the practice, or start the server with the sample dataset:</p>
			<pre>touchline serve --sample</pre>
			<p class="buttons"><a class="button button--primary" href="/import">Import a dataset</a> <a class="button" href="/recordings">Add a video of a match</a> <a class="button" href="/help/practice">Practice</a></p>
		</section>
	`;
}
