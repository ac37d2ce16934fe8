// @ts-check
/** The bar over a group whose independent annotations differ: it gets its verdict by the decision. */

import { html } from 'htm/preact';

import { getGroupIds } from '../api/queue.js';
import { useResource } from '../lib/resource.js';
import { groupDocument } from '../state/group.js';
import { isCopy } from '../state/independent_annotations.js';
import { whyNot } from '../state/rights.js';

/** @import {GroupDocument} from '../api/types.js' */

/** @param {{group: GroupDocument}} props */
function Bar({ group: { id, dataset, revision, verdict } }) {
	const asked = { dataset: dataset.name, q: `id:${id} annotations:waiting`, from: 0, limit: 1 };
	const { value } = useResource(() => getGroupIds(asked), [id, revision, verdict.at]);
	if (!value?.total) return null;
	return html`
		<div class="bar" data-tone="info" role="status">
			<p>The independent annotations of this group differ. It gets no verdict until a reviewer decides between them.</p>
			<a class="button" href=${`/adjudicate/${id}`}>Open the decision</a>
		</div>
	`;
}

/** Nothing for annotators: they are not told what became of independent annotations. */
export function UndecidedBar() {
	const group = groupDocument.value;
	if (!group || isCopy(group) || whyNot('review', group.dataset.name)) return null;
	return html`<${Bar} key=${group.id} group=${group} />`;
}
