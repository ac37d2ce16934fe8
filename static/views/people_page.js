// @ts-check
/** Everybody with an account: inviting, roles, disabling, links for new passwords. */

import { html } from 'htm/preact';
import { useEffect, useState } from 'preact/hooks';

import { getUsers, patchUser, postUser, postUserLink } from '../api/people.js';
import { ApiError } from '../api/problem.js';
import { myName } from '../state/me.js';
import { FormError } from './login.js';
import { Loading, PageFrame, Trouble } from './page_frame.js';
import { When } from './when.js';

/** @import {Role, UserJson, UserWithLink} from '../api/people.js' */

const ROLES = /** @type {{name: Role, note: string}[]} */ ([
	{ name: 'viewer', note: 'looks at everything' },
	{ name: 'annotator', note: 'changes lines, balls and cameras' },
	{ name: 'reviewer', note: 'judges groups, makes exports' },
	{ name: 'lead', note: 'thresholds, versions, imports, evaluations' },
	{ name: 'admin', note: 'people, deleting datasets' },
]);

/** @param {UserJson} one */
function stateOf(one) {
	if (one.disabled) return 'disabled';
	if (one.joined) return one.invited ? 'has a link for a new password' : 'active';
	return one.invited ? 'invited' : 'invitation is too old';
}

/** A link that is shown once. @param {{made: UserWithLink, close: () => void}} props */
function LinkCard({ made, close }) {
	const [copied, setCopied] = useState(false);
	const copy = () => navigator.clipboard?.writeText(made.link).then(() => setCopied(true));
	return html`
		<section class="card" role="status" aria-labelledby="people-link">
			<h2 id="people-link">Send this link to ${made.user.name}</h2>
			<p>It sets their password, works once, until ${new Date(made.expires).toLocaleString('en-GB', { day: 'numeric', month: 'short', hour: '2-digit', minute: '2-digit' })}, and is not shown again.</p>
			<p class="people__link">
				<input class="field" aria-label="Link" readonly value=${made.link} onFocus=${(/** @type {Event} */ event) => /** @type {HTMLInputElement} */ (event.currentTarget).select()} />
				<button class="button" type="button" onClick=${copy}>${copied ? 'Copied' : 'Copy'}</button>
				<button class="button" type="button" onClick=${close}>Done</button>
			</p>
		</section>
	`;
}

/** @param {{invite: (name: string, role: Role) => Promise<boolean>, error: ApiError | null}} props */
function InviteCard({ invite, error }) {
	/** @param {SubmitEvent} event */
	async function send(event) {
		event.preventDefault();
		const form = /** @type {HTMLFormElement} */ (event.currentTarget);
		const said = new FormData(form);
		if (await invite(String(said.get('name')), /** @type {Role} */ (said.get('role')))) form.reset();
	}
	return html`
		<section class="card" aria-labelledby="people-invite">
			<h2 id="people-invite">Invite somebody</h2>
			<form class="form" onSubmit=${send}>
				<div class="form__columns">
					<div class="form__row"><label for="people-name">Name</label><input class="field" id="people-name" name="name" required maxlength="40" autocomplete="off" autocapitalize="none" spellcheck=${false} /><small>Small letters and digits; it stays in the history for good.</small></div>
					<div class="form__row"><label for="people-role">Role</label><select class="field" id="people-role" name="role">${ROLES.map(({ name, note }) => html`<option key=${name} value=${name} selected=${name === 'reviewer'}>${name}: ${note}</option>`)}</select><small>Each may what those above it may.</small></div>
				</div>
				<${FormError} error=${error} />
				<p><button class="button button--primary" type="submit">Make a link</button></p>
			</form>
		</section>
	`;
}

/** @param {{one: UserJson, change: (change: {role?: Role, disabled?: boolean}) => void, link: () => void}} props */
function PersonRow({ one, change, link }) {
	const mine = one.name === myName.value;
	const why = mine ? 'Nobody changes their own rights' : undefined;
	return html`
		<tr>
			<th scope="row">${one.name}${mine ? ' (you)' : ''}<small>invited by ${one.created_by}</small></th>
			<td>
				<select class="field" aria-label=${`Role of ${one.name}`} value=${one.role} disabled=${mine} title=${why} onChange=${(/** @type {Event} */ event) => change({ role: /** @type {Role} */ (/** @type {HTMLSelectElement} */ (event.currentTarget).value) })}>
					${ROLES.map(({ name }) => html`<option key=${name} value=${name}>${name}</option>`)}
				</select>
			</td>
			<td>${stateOf(one)}</td>
			<td>${one.seen ? html`<${When} at=${one.seen} />` : 'not logged in'}</td>
			<td class="table__actions">
				${one.disabled ? null : html`<button class="button button--small" type="button" aria-label=${`New link for ${one.name}`} onClick=${link}>New link</button>`}
				<button class="button button--small ${one.disabled ? '' : 'button--danger'}" type="button" disabled=${mine} title=${why} aria-label=${`${one.disabled ? 'Enable' : 'Disable'} ${one.name}`} onClick=${() => change({ disabled: !one.disabled })}>${one.disabled ? 'Enable' : 'Disable'}</button>
			</td>
		</tr>
	`;
}

/** Everybody, and what can be done about them. */
function usePeople() {
	const [people, setPeople] = useState(/** @type {UserJson[] | null} */ (null));
	const [made, setMade] = useState(/** @type {UserWithLink | null} */ (null));
	const [error, setError] = useState(/** @type {ApiError | null} */ (null));
	const [failure, setFailure] = useState(/** @type {ApiError | null} */ (null));
	const read = () => getUsers().then(({ items }) => { setPeople(items); setFailure(null); }, setFailure);
	useEffect(() => { read(); }, []);
	/** @template T @param {Promise<T>} doing @param {(done: T) => void} [then] */
	async function act(doing, then = () => {}) {
		try {
			then(await doing);
			setError(null);
			return true;
		} catch (problem) {
			if (!(problem instanceof ApiError)) throw problem;
			setError(problem);
			return false;
		} finally {
			read();
		}
	}
	return { people, made, error, failure, read, act, setMade };
}

export function PeoplePage() {
	const { people, made, error, failure, read, act, setMade } = usePeople();
	return html`
		<${PageFrame} current="people" title="People" where=${html`<strong>People</strong>`}>
			${failure ? html`<${Trouble} title="The people cannot be shown" error=${failure} retry=${read} />` : null}
			${!people && !failure ? html`<${Loading} what="people" />` : null}
			${made ? html`<${LinkCard} key=${made.link} made=${made} close=${() => setMade(null)} />` : null}
			${people ? html`
				<${InviteCard} error=${error} invite=${(/** @type {string} */ name, /** @type {Role} */ role) => act(postUser(name, role), setMade)} />
				<section class="card card--flush" aria-labelledby="people-all">
					<h2 id="people-all">Everybody</h2>
					<div class="table__scroll"><table class="table">
						<thead><tr><th>Name</th><th>Role</th><th>State</th><th>Seen</th><td></td></tr></thead>
						<tbody>${people.map((one) => html`
							<${PersonRow}
								key=${one.id} one=${one} link=${() => act(postUserLink(one.id), setMade)}
								change=${(/** @type {{role?: Role, disabled?: boolean}} */ wanted) => act(patchUser(one.id, wanted))}
							/>`)}
						</tbody>
					</table></div>
				</section>` : null}
		<//>
	`;
}
