// @ts-check
/** The guidelines of a dataset, one key away from its groups. */

import { html } from 'htm/preact';
import { useEffect, useRef } from 'preact/hooks';

import { sentenceOf } from '../api/problem.js';
import { getGuidelines } from '../api/independent_annotations.js';
import { useResource } from '../lib/resource.js';
import { groupDocument } from '../state/group.js';
import { guidelinesShown } from '../state/independent_annotations.js';
import { GuidelinesText } from './guidelines_text.js';
import { GuidelinesVersions, versionAt } from './guidelines_versions.js';
import { When } from './when.js';

/** @import {GuidelinesJson} from '../api/independent_annotations.js' */
/** @import {GroupDocument} from '../api/types.js' */

/** Under which version the group was judged, where that is another one than now. @param {{found: GuidelinesJson, group: GroupDocument}} props */
function Past({ found, group }) {
	const { versions, number } = found;
	const { at, state, by } = group.verdict;
	const judged = state !== 'unreviewed' && at ? versionAt(versions, at) : number;
	if (versions.length < 2) return null;
	return html`
		${judged !== number ? html`<p class="guidelines__past" role="status">${judged === null ? 'There were no guidelines yet' : `Version ${judged} was in force`} when ${by ?? 'a reviewer'} reviewed this group.</p>` : null}
		<details open=${judged !== number}><summary>Versions, and what each changed</summary><${GuidelinesVersions} found=${found} may=${false} inForce=${judged} /></details>
	`;
}

/** @param {{group: GroupDocument}} props */
function Body({ group }) {
	const dataset = group.dataset.id;
	const { value, error } = useResource((signal) => getGuidelines(dataset, signal), [dataset]);
	if (error) return html`<p role="alert">${sentenceOf(error)}</p>`;
	if (!value) return html`<p aria-busy="true">Loading…</p>`;
	if (value.number === 0) return html`<p>This dataset has no guidelines yet. Leads write them under <em>Statistics</em>.</p>`;
	return html`
		<${GuidelinesText} dataset=${dataset} text=${value.text} />
		<${Past} found=${value} group=${group} />
		<p class="guidelines__foot">Version ${value.number}, by ${value.versions[0].written_by} <${When} at=${value.versions[0].written} /></p>
	`;
}

export function Guidelines() {
	const dialog = useRef(/** @type {HTMLDialogElement | null} */ (null));
	const group = groupDocument.value;
	useEffect(() => { dialog.current?.showModal(); }, []);
	if (!group) return null;
	return html`
		<dialog class="dialog dialog--wide" ref=${dialog} aria-labelledby="guidelines-title" onClose=${() => { guidelinesShown.value = false; }}>
			<header class="dialog__header">
				<h2 id="guidelines-title">Guidelines</h2>
				<button class="button" type="button" onClick=${() => dialog.current?.close()}>Close <kbd>Esc</kbd></button>
			</header>
			<div class="guidelines__body" tabindex="0" role="region" aria-labelledby="guidelines-title"><${Body} group=${group} /></div>
		</dialog>
	`;
}
