// @ts-check
/**
 * Buttons and fields that say what they need (`data-needs`, and `data-of` where they are about another dataset than the
 * page) are greyed out for whoever may not, and say why.
 */

import { options } from 'preact';

import { dataset } from '../state/datasets.js';
import { groupDocument } from '../state/group.js';
import { refuses, whyNot } from '../state/rights.js';
import { page } from '../lib/router.js';

/** @import {Action} from '../api/people.js' */

/** The dataset that the page is about. */
export function datasetHere() {
	const reviewing = page.value.page === 'review' || page.value.page === 'calibration';
	return (reviewing ? groupDocument.value?.dataset.name : undefined) ?? dataset.value?.name;
}

/** @param {Record<string, any>} props */
function guard(props) {
	const needs = /** @type {Action} */ (props['data-needs']);
	const of = props['data-of'] ?? datasetHere();
	const why = whyNot(needs, of === '' ? undefined : of);
	if (!why) return;
	Object.assign(props, {
		'aria-disabled': 'true', title: why,
		onClick: (/** @type {Event} */ event) => {
			event.preventDefault();
			event.stopPropagation();
			refuses(needs, of === '' ? undefined : of);
		},
	});
	if ('onChange' in props || 'onInput' in props) props.disabled = true;
}

/** Look at everything that is drawn from now on. */
export function startNeeds() {
	const before = options.vnode;
	options.vnode = (vnode) => {
		const props = /** @type {any} */ (vnode.props);
		if (typeof vnode.type === 'string' && props['data-needs']) guard(props);
		before?.(vnode);
	};
}
