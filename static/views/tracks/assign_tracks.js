// @ts-check
/** Tracks of a list become a batch that people judge. */

import { html } from 'htm/preact';
import { useState } from 'preact/hooks';

import { postBatch } from '../../api/work.js';
import { useAttempt } from '../../lib/attempt.js';
import { plural } from '../../lib/format.js';
import { navigate } from '../../lib/router.js';
import { inform } from '../../state/notice.js';
import { FormDialog } from '../dialog.js';
import { FormError } from '../form_error.js';
import { PeopleChoice } from '../work/people_choice.js';

/** @import {ListedTrackJson} from '../../api/tracks.js' */
/** @import {Chosen} from '../work/people_choice.js' */

/** @param {{dataset: string, id: number, tracks: ListedTrackJson[], onClose: () => void, onDone: () => void}} props `tracks`: of the list, those that nobody judged */
export function AssignTracks({ dataset, id, tracks, onClose, onDone }) {
	const [people, setPeople] = useState(/** @type {Chosen} */ ({ annotator: [], reviewer: [] }));
	const { error, busy, attempt } = useAttempt();
	/** @param {FormData} form */
	function send(form) {
		if (busy) return;
		/** @param {string} name */
		const text = (name) => String(form.get(name) ?? '').trim();
		attempt(postBatch(id, {
			name: text('name'), q: '', size: Number(text('size')) || null, annotators: [], reviewers: people.reviewer,
			due: text('due') || null, skip_given: form.has('skip'), tracks: tracks.map((track) => track.id),
		}), (made) => {
			onClose();
			onDone();
			inform(`Batch “${made.name}” created with ${plural(made.groups, 'track')}.`, { label: 'See the work', run: () => navigate('/work') });
		});
	}
	return html`
		<${FormDialog}
			title="Assign tracks" onClose=${onClose} onSubmit=${send}
			buttons=${html`<button class="button button--primary" type="submit" aria-disabled=${busy}>Assign</button>`}
		>
			<p>The batch gets the ${plural(tracks.length, 'track')} of the list that ${tracks.length === 1 ? 'has' : 'have'} no verdict, in the order of the list.</p>
			<div class="form__row"><label for="batch-name">Name</label><input class="field" id="batch-name" name="name" required maxlength="80" autocomplete="off" /></div>
			<div class="form__columns">
			<div class="form__row"><label for="batch-size">Number of tracks, from the top of the list</label><input class="field" id="batch-size" name="size" type="number" min="1" max="10000" placeholder=${`all ${tracks.length}`} /></div>
			<div class="form__row"><label for="batch-due">Due</label><input class="field" id="batch-due" name="due" type="date" /></div>
			</div>
			<label class="form__check"><input type="checkbox" name="skip" defaultChecked /> Skip tracks that are in another open batch</label>
			<${PeopleChoice} dataset=${dataset} chosen=${people} choose=${setPeople} parts=${['reviewer']} />
			${error ? html`<${FormError} error=${error} />` : null}
		<//>
	`;
}
