// @ts-check
/** The notice of maintenance above everything else, and the card by which an admin sets it. */

import { html } from 'htm/preact';

import { deleteMaintenance, putMaintenance } from '../api/maintenance.js';
import { useAttempt } from '../lib/attempt.js';
import { withForm } from '../lib/field.js';
import { banner, hideBanner, shownBanner, publishBanner } from '../state/maintenance.js';
import { FormError } from './form_error.js';

/** @param {string} at */
const timeText = (at) => new Date(at).toLocaleString('en-GB', { day: 'numeric', month: 'short', hour: '2-digit', minute: '2-digit' });

export function MaintenanceBar() {
	const one = shownBanner.value;
	// Always there, so that what comes into it is read out.
	return html`
		<div class="maintenance" aria-live="polite">${one ? html`
			<div class="bar" data-tone="warn">
				<p><strong>Maintenance:</strong> ${one.text}${one.until ? html` <span class="maintenance__until">(until ${timeText(one.until)})</span>` : null}</p>
				<button class="button" type="button" aria-label="Dismiss the notice of maintenance" onClick=${hideBanner}>Dismiss</button>
			</div>` : null}
		</div>
	`;
}

/** A time of a field, with its zone; null: none. @param {FormDataEntryValue | null} said */
const timeOf = (said) => (said ? new Date(String(said)).toISOString() : null);

export function MaintenanceCard() {
	const { error, busy, attempt } = useAttempt();
	const one = banner.value;
	const set = withForm(async (said, form) => {
		const wanted = { text: String(said.get('text')), starts: timeOf(said.get('starts')), until: timeOf(said.get('until')) };
		if (await attempt(putMaintenance(wanted), publishBanner)) form.reset();
	});
	return html`
		<section class="card" aria-labelledby="people-maintenance">
			<h2 id="people-maintenance">Maintenance notice</h2>
			${one ? html`<p>Current notice: “${one.text}”${one.starts ? `, from ${timeText(one.starts)}` : ''}${one.until ? `, until ${timeText(one.until)}` : ''}. <button class="button button--small" type="button" disabled=${busy} onClick=${() => attempt(deleteMaintenance(), () => publishBanner(null))}>Clear</button></p>` : null}
			<form class="form" onSubmit=${set}>
				<div class="form__row"><label for="maintenance-text">Text</label><input class="field" id="maintenance-text" name="text" required maxlength="300" autocomplete="off" placeholder="Upgrade at 18:00, about ten minutes" /><small>All people see it on every page, even before login.</small></div>
				<div class="form__columns">
					<div class="form__row"><label for="maintenance-starts">From (optional)</label><input class="field" id="maintenance-starts" name="starts" type="datetime-local" /></div>
					<div class="form__row"><label for="maintenance-until">Until (optional)</label><input class="field" id="maintenance-until" name="until" type="datetime-local" /></div>
				</div>
				<${FormError} error=${error} />
				<p><button class="button" type="submit" aria-disabled=${busy}>Show the notice</button></p>
			</form>
		</section>
	`;
}
