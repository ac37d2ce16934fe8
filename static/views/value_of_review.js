// @ts-check
/** What the order "value of review" means, in one line. */

import { html } from 'htm/preact';

import { valueOf } from '../state/query.js';

export const VALUE_OF_REVIEW = 'The groups closest to a gate’s threshold come first: there a small mistake decides whether the group passes.';

/** The line, while the queue has this order. @param {{q: string}} props */
export function ValueOfReview({ q }) {
	const sort = valueOf(q, 'sort');
	if (sort !== 'value' && sort !== 'value-desc') return null;
	return html`<p class="queue-tools__order" id="order-explained"><strong>Value of review${sort === 'value' ? '' : ', reversed'}:</strong> ${VALUE_OF_REVIEW}${sort === 'value' ? '' : ' Here they come last.'}</p>`;
}
