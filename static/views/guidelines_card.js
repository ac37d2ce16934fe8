// @ts-check
/** Guidelines of a dataset: read by everybody, written by its leads, every version kept. */

import { html } from 'htm/preact';
import { useRef, useState } from 'preact/hooks';

import { postUpload } from '../api/imports.js';
import { getGuidelines, postGuidelinePicture, putGuidelines } from '../api/independent_annotations.js';
import { useAttempt } from '../lib/attempt.js';
import { plural } from '../lib/format.js';
import { pictureLine } from '../lib/guideline_parts.js';
import { useResource } from '../lib/resource.js';
import { whyNot } from '../state/rights.js';
import { FormError } from './form_error.js';
import { GuidelinesText } from './guidelines_text.js';
import { GuidelinesVersions } from './guidelines_versions.js';
import { Trouble } from './page_frame.js';

/** @import {DatasetJson} from '../api/types.js' */
/** @import {GuidelinesJson} from '../api/independent_annotations.js' */

/** @param {{one: DatasetJson, found: GuidelinesJson, close: () => void}} props */
function Editor({ one, found, close }) {
	const area = useRef(/** @type {HTMLTextAreaElement | null} */ (null));
	const { error, attempt } = useAttempt();
	/** @param {SubmitEvent} event */
	function save(event) {
		event.preventDefault();
		attempt(putGuidelines(one.id, area.current?.value ?? '', found.number), close);
	}
	/** @param {HTMLInputElement} field */
	async function addPicture(field) {
		const file = field.files?.[0];
		if (!file) return;
		const { id } = await postUpload(file, () => {});
		const { digest } = await postGuidelinePicture(one.id, id);
		const text = area.current;
		text?.setRangeText(`\n\n${pictureLine(file.name, digest)}\n\n`, text.selectionEnd, text.selectionEnd, 'end');
		field.value = '';
	}
	return html`
		<form class="form" onSubmit=${save}>
			<div class="form__row">
				<label for="guidelines-text">Text, in Markdown: headings with ##, lists with -, **strong**, tables</label>
				<textarea class="field guidelines__field" id="guidelines-text" ref=${area} rows="14" maxlength="100000">${found.text}</textarea>
			</div>
			<div class="form__row">
				<label for="guidelines-picture">Put a picture where the cursor is (PNG, JPEG or WebP, up to 4 MB)</label>
				<input id="guidelines-picture" type="file" accept="image/png,image/jpeg,image/webp" onChange=${(/** @type {Event} */ event) => attempt(addPicture(/** @type {HTMLInputElement} */ (event.currentTarget)))} />
			</div>
			${error ? html`<${FormError} error=${error} />` : null}
			<p class="dialog__buttons"><button class="button button--primary">Save as version ${found.number + 1}</button><button class="button" type="button" onClick=${close}>Cancel</button></p>
		</form>
	`;
}

/** @param {{dataset: DatasetJson}} props */
export function GuidelinesCard({ dataset }) {
	const may = whyNot('lead', dataset.name) === '';
	const { value: found, error, reload } = useResource((signal) => getGuidelines(dataset.id, signal), [dataset.id]);
	const [editing, setEditing] = useState(false);
	if (!found && !error) return null;
	return html`
		<section class="card" aria-labelledby="guidelines-card-title">
			<h2 id="guidelines-card-title">Guidelines</h2>
			${error ? html`<${Trouble} title="The guidelines cannot be shown" error=${error} retry=${reload} />` : null}
			${found && editing ? html`<${Editor} one=${dataset} found=${found} close=${() => { setEditing(false); reload(); }} />` : null}
			${found && !editing ? html`
				<p>${found.number === 0 ? 'No guidelines yet. They tell annotators how to annotate this dataset.' : html`${plural(found.versions.length, 'version')}, the last by ${found.versions[0].written_by}.`} In a group <kbd>Shift G</kbd> shows them.</p>
				${found.number > 0 ? html`<details><summary>Read them</summary><${GuidelinesText} dataset=${dataset.id} text=${found.text} /></details>` : null}
				${found.versions.length > 1 ? html`<details><summary>Versions, and what each changed</summary><${GuidelinesVersions} found=${found} may=${may} changed=${reload} /></details>` : null}
				${may ? html`<p><button class="button" type="button" onClick=${() => setEditing(true)}>${found.number === 0 ? 'Write guidelines' : 'Edit guidelines'}</button></p>` : null}` : null}
		</section>
	`;
}
