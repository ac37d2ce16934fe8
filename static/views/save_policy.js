// @ts-check
/** Giving a dataset other thresholds: a name, then the job that solves what they change. */

import { html } from 'htm/preact';
import { useState } from 'preact/hooks';

import { sentenceOf } from '../api/problem.js';
import { withValue } from '../lib/field.js';
import { follow } from '../state/jobs.js';
import { FormDialog } from './dialog.js';
import { JobProgress } from './job_progress.js';

/** @import {JobJson} from '../api/jobs.js' */

/**
 * Send a policy and follow the job that it starts.
 *
 * @param {() => void} saved when the dataset has the policy, and when its job is over
 * @returns {{job: JobJson | null, busy: boolean, error: string, send: (put: () => Promise<JobJson>) => Promise<boolean>}}
 */
export function useSavePolicy(saved) {
	const [state, setState] = useState(/** @type {{job: JobJson | null, busy: boolean, error: string}} */ ({ job: null, busy: false, error: '' }));
	/** @param {() => Promise<JobJson>} put */
	async function send(put) {
		setState({ job: null, busy: true, error: '' });
		try {
			const job = await put();
			// The policy is in force at once; what it leaves without a solution follows.
			saved();
			const over = await follow(job, (moved) => setState({ job: moved, busy: true, error: '' }));
			setState({ job: over, busy: false, error: '' });
			saved();
			return over.state === 'done';
		} catch (error) {
			setState({ job: null, busy: false, error: sentenceOf(error) });
			return false;
		}
	}
	return { ...state, send };
}

/**
 * @param {{
 *   name: string, changed: number, put: (name: string) => Promise<JobJson>,
 *   onSaved: () => void, onClose: () => void
 * }} props
 */
export function SavePolicy({ name, changed, put, onSaved, onClose }) {
	const [typed, setTyped] = useState(name);
	const { job, busy, error, send } = useSavePolicy(onSaved);
	const done = job?.state === 'done';
	const why = busy ? 'Under way' : typed.trim() ? '' : 'A policy needs a name';
	async function submit() {
		if (done) onClose();
		else if (!why) await send(() => put(typed.trim()));
	}
	return html`
		<${FormDialog}
			title="Save as policy" onClose=${onClose} onSubmit=${submit}
			buttons=${html`<button class="button button--primary" type="submit" aria-disabled=${why !== ''} title=${why}>${busy ? 'Solving…' : done ? 'Done' : 'Save and solve'}</button>`}
		>
			${job ? null : html`<p>${changed} ${changed === 1 ? 'threshold differs' : 'thresholds differ'} from the saved policy. Groups are judged again; only what depends on these thresholds is computed.
				Verdicts on groups that change are kept and marked stale.</p>`}
			<div class="form__row">
				<label for="policy-name">Name</label>
				<input
					class="field" id="policy-name" maxlength="80" autocomplete="off" value=${typed} disabled=${busy || done}
					onInput=${withValue(setTyped)}
				/>
			</div>
			${job ? html`<${JobProgress} job=${job} />` : null}
			${error ? html`<p class="form__error" role="alert">${error}</p>` : null}
		<//>
	`;
}
