// @ts-check
/** What somebody who is here for the first time may want: the practice, or the guide. */

import { html } from 'htm/preact';

import { endFirstSteps, making, makingFailed, offerFirstSteps, startPractice } from '../state/practice.js';
import { whyNot } from '../state/rights.js';
import { openHelpAt } from '../state/workspace.js';
import { JobProgress } from './job_progress.js';

/** Only the sample is offered it: who has brought data of their own knows what to do. */
const SAMPLE = 'sample';

/** @param {{dataset: string}} props */
export function FirstSteps({ dataset }) {
	if (dataset !== SAMPLE || !offerFirstSteps.value || whyNot('annotate')) return null;
	return html`
		<section class="card first-steps" aria-label="First steps">
			<p><strong>New here?</strong> Learn it on eight made-up groups: you decide, and see at once whether it was right.</p>
			<p class="buttons">
				<button class="button button--primary" type="button" aria-disabled=${making.value !== null} onClick=${() => startPractice()}>Practice with eight groups (5 minutes)</button>
				<button class="button" type="button" onClick=${() => openHelpAt('guide')}>Read the guide</button>
				<button class="button" type="button" onClick=${endFirstSteps}>No, thanks</button>
			</p>
			${making.value ? html`<${JobProgress} job=${making.value} cancellable=${false} />` : null}
			${makingFailed.value ? html`<p class="form__error" role="alert">${makingFailed.value}</p>` : null}
		</section>
	`;
}
