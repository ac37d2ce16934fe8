// @ts-check
/** Queries that somebody gave a name. */

import { html } from 'htm/preact';
import { useState } from 'preact/hooks';

import { deleteSavedView, getSavedViews, postSavedView } from '../api/queue.js';
import { useAttempt } from '../lib/attempt.js';
import { withValue } from '../lib/field.js';
import { plural } from '../lib/format.js';
import { useResource } from '../lib/resource.js';
import { announce } from '../state/notice.js';
import { FormError } from './form_error.js';
import { Popover } from './popover.js';

/** @import {DatasetJson} from '../api/types.js' */

/** @param {{q: string, save: (name: string) => Promise<boolean>}} props   `save`: whether it was */
function SaveForm({ q, save }) {
	const [name, setName] = useState('');
	/** @param {SubmitEvent} event */
	async function send(event) {
		event.preventDefault();
		if (!name.trim()) return;
		if (await save(name.trim())) setName('');
	}
	if (!q) return html`<p class="empty-note">Type a query to save it under a name.</p>`;
	return html`
		<form class="popover__form" onSubmit=${send}>
			<label for="view-name">Save <code>${q}</code> as</label>
			<div class="buttons">
				<input
					class="field" id="view-name" maxlength="80" autocomplete="off" value=${name}
					onInput=${withValue(setName)}
				/>
				<button data-needs="annotate" class="button" type="submit" aria-disabled=${!name.trim()}>Save</button>
			</div>
		</form>
	`;
}

/** @param {{dataset: DatasetJson, q: string, open: (q: string) => void}} props */
function Views({ dataset, q, open }) {
	const views = useResource((signal) => getSavedViews(dataset.id, signal), [dataset.id]);
	const { error, attempt } = useAttempt();
	/** @param {() => Promise<unknown>} work @param {string} said */
	const change = (work, said) => attempt(work(), () => { announce(said); views.reload(); });
	const items = views.value?.items ?? [];
	return html`
		<h2>Saved views of ${dataset.name}</h2>
		${views.error ? html`<${FormError} error=${views.error} />` : null}
		${views.value && items.length === 0 ? html`<p class="empty-note">None yet.</p>` : null}
		<ul class="saved-views">
			${items.map((view) => html`
				<li key=${view.id}>
					<button class="saved-views__open" type="button" aria-current=${view.q === q ? 'true' : undefined} onClick=${() => open(view.q)}>
						${view.name} <span class="saved-views__count">${plural(view.groups, 'group')} · ${view.by}</span><small>${view.q}</small>
					</button>
					<button
						class="icon-button" type="button" data-needs="annotate" aria-label=${`Delete the view ${view.name}`} title="Delete"
						onClick=${() => change(() => deleteSavedView(view.id), `View ${view.name} deleted.`)}
					><svg viewBox="0 0 16 16" aria-hidden="true"><path d="m4 4 8 8M12 4l-8 8" /></svg></button>
				</li>`)}
		</ul>
		<${SaveForm} q=${q} save=${(/** @type {string} */ name) => change(() => postSavedView(dataset.id, { name, q }), `View ${name} saved.`)} />
		${error ? html`<${FormError} error=${error} />` : null}
	`;
}

/** @param {{dataset: DatasetJson, q: string, onQuery: (q: string) => void}} props */
export function SavedViews({ dataset, q, onQuery }) {
	return html`
		<${Popover} id="saved-views" label="Views">
			${(/** @type {() => void} */ close) => html`
				<${Views} dataset=${dataset} q=${q} open=${(/** @type {string} */ saved) => { close(); onQuery(saved); }} />`}
		<//>
	`;
}
