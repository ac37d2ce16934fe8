// @ts-check
/** Inviting many people at once: a list, a dry run, and a report of each row. */

import { html } from 'htm/preact';
import { useState } from 'preact/hooks';

import { postInvitations } from '../api/people.js';
import { useAttempt } from '../lib/attempt.js';
import { withValue } from '../lib/field.js';
import { plural } from '../lib/format.js';
import { readInvitations } from '../lib/invitation_list.js';
import { saveText } from '../lib/save_text.js';
import { FormError } from './form_error.js';

/** @import {InvitationReport} from '../api/people.js' */

const WORDS = { invited: 'invited', possible: 'can be invited', refused: 'refused' };

/** @param {{report: InvitationReport}} props */
function Report({ report }) {
	const links = report.items.filter(({ link }) => link);
	const save = () => saveText('invitations.csv', ['name,role,link', ...links.map(({ name, role, link }) => `${name},${role},${link}`), ''].join('\n'));
	return html`
		<p role="status">${report.dry_run ? 'Dry run, nothing is changed: ' : ''}${plural(report.invited, 'person').replace('persons', 'people')} ${report.dry_run ? 'can be invited' : 'invited'}, ${report.refused} refused${report.mailed ? `, ${plural(report.mailed, 'link')} sent by mail` : ''}.</p>
		${links.length ? html`<p>These links set a password, work once, and are not shown again. <button class="button button--small" type="button" onClick=${save}>Save ${plural(links.length, 'link')} as CSV</button></p>` : null}
		<div class="table__scroll"><table class="table">
			<thead><tr><th>Row</th><th>Name</th><th>Role</th><th>State</th><th>Link</th></tr></thead>
			<tbody>${report.items.map((one) => html`
				<tr key=${one.row}>
					<td>${one.row}</td><th scope="row">${one.name || '–'}</th><td>${one.role}</td>
					<td>${WORDS[one.state]}${one.problem ? html`<small class="form__error">${one.problem}</small>` : null}</td>
					<td>${one.link ? html`<input class="field people__row-link" aria-label=${`Link of ${one.name}`} readonly value=${one.link} onFocus=${(/** @type {Event} */ event) => /** @type {HTMLInputElement} */ (event.currentTarget).select()} />` : one.mailed ? 'sent by mail' : ''}</td>
				</tr>`)}
			</tbody>
		</table></div>
	`;
}

/** @param {{mail: boolean, invited: () => void}} props `invited`: people were made */
export function InviteManyCard({ mail, invited }) {
	const [text, setText] = useState('');
	const [report, setReport] = useState(/** @type {InvitationReport | null} */ (null));
	const { error, busy, attempt } = useAttempt();
	const people = readInvitations(text);
	/** What a dry run said is of the list as it was. @param {string} list */
	function write(list) {
		setText(list);
		setReport(null);
	}
	/** @param {boolean} dryRun */
	const ask = (dryRun) => attempt(postInvitations(people, dryRun), (done) => {
		setReport(done);
		if (dryRun) return;
		setText('');
		invited();
	});
	/** @param {Event} event */
	const take = async ({ target }) => {
		const file = /** @type {HTMLInputElement} */ (target).files?.[0];
		if (file) write(await file.text());
	};
	const why = people.length === 0 ? 'The list is empty' : undefined;
	return html`
		<section class="card" aria-labelledby="people-many">
			<h2 id="people-many">Invite many</h2>
			<form class="form" onSubmit=${(/** @type {Event} */ event) => event.preventDefault()}>
				<div class="form__row">
					<label for="people-list">People, one per line: name, role, e-mail</label>
					<textarea class="field" id="people-list" rows="5" spellcheck=${false} placeholder=${'anna,reviewer,anna@example.org\nben,annotator'} value=${text} onInput=${withValue(write)}></textarea>
					<small>${mail ? 'Where there is an address, the link goes by mail and is not shown.' : 'This server sends no mail: all links are shown here.'}</small>
				</div>
				<div class="form__row"><label for="people-file">Or a CSV file</label><input class="field" id="people-file" type="file" accept=".csv,.txt,text/csv,text/plain" onChange=${take} /></div>
				<${FormError} error=${error} />
				<p class="buttons">
					<button class="button" type="button" disabled=${busy || why} title=${why} onClick=${() => ask(true)}>Dry run</button>
					<button class="button button--primary" type="button" disabled=${busy || why} title=${why} onClick=${() => ask(false)}>Invite${people.length ? ` ${plural(people.length, 'person').replace('persons', 'people')}` : ''}</button>
				</p>
			</form>
			${report ? html`<${Report} report=${report} />` : null}
		</section>
	`;
}
