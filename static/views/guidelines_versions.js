// @ts-check
/** Every version of the guidelines: read one, see the words that it changed, let an older one count again. */

import { html } from 'htm/preact';
import { useState } from 'preact/hooks';

import { getGuidelines, putGuidelines } from '../api/independent_annotations.js';
import { useAttempt } from '../lib/attempt.js';
import { useResource } from '../lib/resource.js';
import { wordChanges } from '../lib/word_changes.js';
import { FormError } from './form_error.js';
import { GuidelinesText } from './guidelines_text.js';
import { When } from './when.js';

/** @import {GuidelinesJson} from '../api/independent_annotations.js' */

/** Letters of an unchanged passage that are shown on either side of a change. */
const AROUND = 160;

/** An unchanged passage without its middle. @param {string} text @param {boolean} first @param {boolean} last */
function shortened(text, first, last) {
	const [head, tail] = [first ? '' : text.slice(0, AROUND), last ? '' : text.slice(-AROUND)];
	return text.length <= head.length + tail.length + AROUND ? text : `${head} … ${tail}`;
}

/** @param {{before: string, after: string}} props */
function WordChanges({ before, after }) {
	const changes = wordChanges(before, after);
	if (changes.every(({ kind }) => kind === 'same')) return html`<p>The texts are the same.</p>`;
	return html`<p class="guidelines__changes">${changes.map(({ kind, text }, i) => {
		if (kind === 'gone') return html`<del key=${i}><span class="hidden-text">removed: </span>${text}</del>`;
		if (kind === 'new') return html`<ins key=${i}><span class="hidden-text">added: </span>${text}</ins>`;
		return html`<span key=${i}>${shortened(text, i === 0, i === changes.length - 1)}</span>`;
	})}</p>`;
}

/** @param {{dataset: number, number: number, against: number | null}} props `against`: shown are the words that changed since that version */
function Version({ dataset, number, against }) {
	const one = useResource((signal) => getGuidelines(dataset, signal, number), [dataset, number]);
	const other = useResource((signal) => (against ? getGuidelines(dataset, signal, against) : Promise.resolve(null)), [dataset, against]);
	const error = one.error ?? other.error;
	if (error) return html`<${FormError} error=${error} />`;
	if (!one.value || one.value.number !== number || (against && other.value?.number !== against)) return html`<p aria-busy="true">Loading…</p>`;
	if (against === null) return html`<${GuidelinesText} dataset=${dataset} text=${one.value.text} />`;
	return html`<${WordChanges} before=${against ? other.value?.text ?? '' : ''} after=${one.value.text} />`;
}

/**
 * @param {{
 *   found: GuidelinesJson, may: boolean, inForce?: number | null, changed?: () => void
 * }} props `may`: may write; `inForce`: a version that is marked, with why
 */
export function GuidelinesVersions({ found, may, inForce = null, changed }) {
	const [shown, setShown] = useState(/** @type {{number: number, against: number | null} | null} */ (null));
	const { error, attempt } = useAttempt();
	const { dataset, versions } = found;
	const [newest] = versions;
	/** @param {number} number */
	async function takeBack(number) {
		const { text } = await getGuidelines(dataset, undefined, number);
		await putGuidelines(dataset, text, newest.number);
		setShown(null);
		changed?.();
	}
	/** @param {number} number @param {number | null} against */
	const turn = (number, against) => setShown(shown?.number === number && shown.against === against ? null : { number, against });
	return html`
		<div class="table__scroll guidelines__versions" tabindex="0" role="region" aria-label="Versions of the guidelines">
			<table class="table">
				<thead><tr><th>version</th><th>written</th><th>by</th><th><span class="hidden-text">what to do</span></th></tr></thead>
				<tbody>${versions.map(({ number, written, written_by: by }, i) => html`
					<tr key=${number} data-shown=${shown?.number === number}>
						<th scope="row">${number}${i === 0 ? html` <small>in force</small>` : null}${number === inForce && i > 0 ? html` <small>when it was reviewed</small>` : null}</th>
						<td><${When} at=${written} /></td><td>${by}</td>
						<td class="guidelines__deeds">
							<button class="button button--small" type="button" aria-pressed=${shown?.number === number && shown.against === null} onClick=${() => turn(number, null)}>Read<span class="hidden-text"> version ${number}</span></button>
							${i < versions.length - 1 ? html`<button class="button button--small" type="button" aria-pressed=${shown?.number === number && shown.against === versions[i + 1].number} onClick=${() => turn(number, versions[i + 1].number)}>What it changed<span class="hidden-text"> in version ${number}</span></button>` : null}
							${i > 0 ? html`<button class="button button--small" type="button" aria-pressed=${shown?.number === newest.number && shown.against === number} onClick=${() => turn(newest.number, number)}>Changed since<span class="hidden-text"> version ${number}</span></button>` : null}
							${may && i > 0 ? html`<button class="button button--small" type="button" title=${`Its text becomes version ${newest.number + 1}; every version stays`} onClick=${() => attempt(takeBack(number))}>Restore<span class="hidden-text"> version ${number}</span></button>` : null}
						</td>
					</tr>`)}</tbody>
			</table>
		</div>
		${error ? html`<${FormError} error=${error} />` : null}
		${shown ? html`<section class="guidelines__shown" aria-live="polite" aria-label=${shown.against === null ? `Version ${shown.number}` : `From version ${shown.against} to ${shown.number}`}>
			<h3>${shown.against === null ? `Version ${shown.number}` : `From version ${shown.against} to ${shown.number}`}</h3>
			<${Version} dataset=${dataset} number=${shown.number} against=${shown.against} />
		</section>` : null}
	`;
}

/** The version that counted at a moment; null: there was none. @param {GuidelinesJson['versions']} versions the newest first @param {string} at */
export const versionAt = (versions, at) => versions.find(({ written }) => Date.parse(written) <= Date.parse(at))?.number ?? null;
