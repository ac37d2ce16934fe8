// @ts-check
/** Deleting a dataset: only whoever types its name means it. */

import { html } from 'htm/preact';
import { useState } from 'preact/hooks';

import { deleteDataset, previewDeletion } from '../api/datasets.js';
import { useAttempt } from '../lib/attempt.js';
import { withValue } from '../lib/field.js';
import { count, words } from '../lib/format.js';
import { useResource } from '../lib/resource.js';
import { loadDatasets } from '../state/datasets.js';
import { announce } from '../state/notice.js';
import { FormDialog } from './dialog.js';
import { FormError } from './form_error.js';

/** @import {DatasetJson} from '../api/types.js' */

/** @param {{one: DatasetJson, onClose: () => void}} props */
export function DeleteDataset({ one, onClose }) {
	const [typed, setTyped] = useState('');
	const { error, busy, attempt } = useAttempt();
	const preview = useResource((signal) => previewDeletion(one.id, signal), [one.id]);
	const counts = Object.entries(preview.value?.counts ?? {}).filter(([, n]) => n > 0);
	const meant = typed === one.name;
	function send() {
		if (!meant || busy) return;
		attempt(deleteDataset(one.id, typed).then(loadDatasets), () => {
			announce(`Dataset ${one.name} is deleted.`);
			onClose();
		});
	}
	return html`
		<${FormDialog}
			title=${`Delete ${one.name}?`} onClose=${onClose} onSubmit=${send}
			buttons=${html`
				<button
					class="button button--danger" type="submit" aria-disabled=${!meant || busy}
					title=${meant ? '' : 'Type the name of the dataset first'}
				>${busy ? 'Deleting…' : 'Delete for good'}</button>`}
		>
			<p><strong>${one.name}</strong> is deleted with every edit, verdict, batch, independent annotation, frozen version, prediction and evaluation. Frames on disk stay. This cannot be undone.</p>
			${counts.length ? html`<dl class="number-list">${counts.map(([name, n]) => html`<div key=${name}><dt>${words(name)}</dt><dd>${count(n)}</dd></div>`)}</dl>` : null}
			<div class="form__row">
				<label for="delete-name">Type <strong>${one.name}</strong> to confirm</label>
				<input
					class="field" id="delete-name" autocomplete="off" spellcheck=${false} value=${typed}
					onInput=${withValue(setTyped)}
				/>
			</div>
			${error ? html`<${FormError} error=${error} />` : null}
		<//>
	`;
}
