// @ts-check
/** Asked before something is handed back, with a sentence why, or taken over: what comes of it. */

import { html } from 'htm/preact';

import { useAttempt } from '../lib/attempt.js';
import { question } from '../state/return_group.js';
import { FormDialog } from './dialog.js';
import { FormError } from './form_error.js';

/** As the server has it (app/features/independent_annotations/adopt.py). */
const MAX_REASON = 500;

export function ReturnDialog() {
	const asked = question.value;
	const { error, busy, attempt } = useAttempt();
	if (!asked) return null;
	const back = asked.kind === 'back';
	const close = () => { question.value = null; };
	/** @param {FormData} form */
	function send(form) {
		if (!busy && asked) attempt(asked.send(String(form.get('reason') ?? '').trim()), close);
	}
	return html`
		<${FormDialog}
			title=${back ? `Return to ${asked.person}` : `Apply ${asked.person}’s annotation to the group`} onClose=${close} onSubmit=${send}
			buttons=${html`<button class="button button--primary" type="submit" autofocus=${!back} aria-disabled=${busy}>${back ? 'Return' : 'Apply'} <kbd>Enter</kbd></button>`}
		>
			<p>${asked.says}</p>
			${back ? html`
				<div class="form__row">
					<label for="hand-back-reason">Reason</label>
					<input class="field" id="hand-back-reason" name="reason" required maxlength=${MAX_REASON} autocomplete="off" placeholder="The far goal line is missing in view B." />
				</div>` : null}
			${error ? html`<${FormError} error=${error} />` : null}
		<//>
	`;
}
