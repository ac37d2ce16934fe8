// @ts-check
/** Everybody with an account: inviting, roles, disabling, links for new passwords. */

import { html } from 'htm/preact';
import { useEffect, useRef, useState } from 'preact/hooks';

import { deleteSecondFactorOf, getTeam, getUsers, patchUser, postAdoption, postUser, postUserLink, putTeam } from '../api/people.js';
import { ApiError } from '../api/problem.js';
import { deleteIdentityOf } from '../api/sign_on.js';
import { endToken, getTokens } from '../api/tokens.js';
import { useAttempt } from '../lib/attempt.js';
import { withForm, withTick, withValue } from '../lib/field.js';
import { plural } from '../lib/format.js';
import { useResource } from '../lib/resource.js';
import { datasets } from '../state/datasets.js';
import { isTeam, myName } from '../state/me.js';
import { CopyField } from './copy_field.js';
import { FormError } from './form_error.js';
import { InviteManyCard } from './invite_many_card.js';
import { MaintenanceCard } from './maintenance_bar.js';
import { MembersCard } from './members_card.js';
import { Loading, NoAccounts, PageFrame, Trouble } from './page_frame.js';
import { TokenTable } from './token_table.js';
import { When } from './when.js';

/** @import {Role, UserJson, UserWithLink} from '../api/people.js' */
/** @import {TokenJson} from '../api/tokens.js' */

const ROLES = /** @type {{name: Role, note: string}[]} */ ([
	{ name: 'none', note: 'sees only datasets in which they have a role' },
	{ name: 'viewer', note: 'views groups and numbers' },
	{ name: 'annotator', note: 'changes lines, balls and cameras' },
	{ name: 'reviewer', note: 'reviews groups, exports datasets' },
	{ name: 'lead', note: 'manages thresholds, versions, imports, evaluations' },
	{ name: 'admin', note: 'manages people, deletes datasets' },
]);

/** @param {UserJson} one */
function stateOf(one) {
	if (one.disabled) return 'disabled';
	if (one.joined) return one.invited ? 'has a link for a new password' : 'active';
	return one.invited ? 'invited' : 'invitation has expired';
}

/** Who let somebody in; whoever did it themselves was the first admin, or came by single sign-on. @param {UserJson} one */
function cameBy({ name, created_by: by, sign_on: identity }) {
	if (by !== name) return `invited by ${by}`;
	return identity ? 'joined by single sign-on' : 'first admin of this server';
}

/** A link that is shown once, or was sent by mail. @param {{made: UserWithLink, close: () => void}} props */
function LinkCard({ made, close }) {
	if (made.link === null) {
		return html`
			<section class="card" role="status" aria-labelledby="people-link">
				<h2 id="people-link">${made.user.joined ? `${made.user.name} has a link for a new password` : `${made.user.name} is invited`}</h2>
				<p>The link was sent by mail. If it does not arrive, press <em>New link</em> below.</p>
				<p class="buttons"><button class="button" type="button" onClick=${close}>Done</button></p>
			</section>
		`;
	}
	return html`
		<section class="card" role="status" aria-labelledby="people-link">
			<h2 id="people-link">Send this link to ${made.user.name}</h2>
			${made.problem ? html`<p class="form__error">It was not sent by mail: ${made.problem}.</p>` : null}
			<p>It sets their password, works once, until ${new Date(made.expires).toLocaleString('en-GB', { day: 'numeric', month: 'short', hour: '2-digit', minute: '2-digit' })}, and is not shown again.</p>
			<${CopyField} label="Link" text=${made.link} close=${close} />
		</section>
	`;
}

/** Where another link for somebody goes, on a server that sends mail. @param {{of: UserJson, renew: (email: string) => Promise<boolean>, error: ApiError | null, close: () => void}} props */
function NewLinkCard({ of, renew, error, close }) {
	const field = useRef(/** @type {HTMLInputElement | null} */ (null));
	useEffect(() => field.current?.focus(), []);
	const send = withForm(async (said) => {
		if (await renew(String(said.get('email')))) close();
	});
	return html`
		<section class="card" aria-labelledby="people-new-link">
			<h2 id="people-new-link">New link for ${of.name}</h2>
			<form class="form" onSubmit=${send}>
				<div class="form__row"><label for="people-link-email">E-mail (optional)</label><input class="field" id="people-link-email" name="email" type="email" maxlength="254" autocomplete="off" ref=${field} /><small>The link is sent there. If you leave it empty, the link is shown here. The address is not stored.</small></div>
				<${FormError} error=${error} />
				<p class="buttons"><button class="button button--primary" type="submit">Make a new link</button><button class="button" type="button" onClick=${close}>Cancel</button></p>
			</form>
		</section>
	`;
}

/** Whether everybody needs a second factor. @param {{act: (doing: Promise<unknown>) => Promise<boolean>}} props */
function FactorRule({ act }) {
	const [on, setOn] = useState(/** @type {boolean | null} */ (null));
	const [asked, setAsked] = useState(/** @type {boolean | null} */ (null));
	const last = useRef(/** @type {Promise<unknown>} */ (Promise.resolve()));
	/** @param {{require_second_factor: boolean}} said */
	const told = (said) => setOn(said.require_second_factor);
	useEffect(() => { act(getTeam().then(told)); }, []);
	if (on === null) return null;
	/** One after the other; what is ticked last stands until it is answered. @param {boolean} ticked */
	const ask = (ticked) => {
		setAsked(ticked);
		const mine = last.current.then(() => act(putTeam(ticked).then(told))).then(() => { if (last.current === mine) setAsked(null); });
		last.current = mine;
	};
	return html`
		<p class="people__rule"><label class="form__check">
			<input type="checkbox" checked=${asked ?? on} onChange=${withTick(ask)} />
			<span>Require a second factor: people without one must set it up at their next login</span>
		</label></p>
	`;
}

/** The tokens of somebody. @param {{of: UserJson, act: (doing: Promise<unknown>) => Promise<boolean>, close: () => void}} props */
function TokensCard({ of, act, close }) {
	const [tokens, setTokens] = useState(/** @type {TokenJson[]} */ ([]));
	const read = () => act(getTokens(of.id).then(({ items }) => setTokens(items)));
	useEffect(() => { read(); }, [of.id]);
	return html`
		<section class="card card--flush" aria-labelledby="people-tokens">
			<h2 id="people-tokens">Tokens of ${of.name}</h2>
			<${TokenTable} tokens=${tokens} end=${(/** @type {number} */ id) => act(endToken(id, of.id)).then(read)} />
			<p class="buttons"><button class="button" type="button" onClick=${close}>Done</button></p>
		</section>
	`;
}

/** @param {{invite: (name: string, role: Role, email: string) => Promise<boolean>, mail: boolean, error: ApiError | null}} props */
function InviteCard({ invite, mail, error }) {
	const send = withForm(async (said, form) => {
		if (await invite(String(said.get('name')), /** @type {Role} */ (said.get('role')), String(said.get('email') ?? ''))) form.reset();
	});
	return html`
		<section class="card" aria-labelledby="people-invite">
			<h2 id="people-invite">Invite a person</h2>
			<form class="form" onSubmit=${send}>
				<div class="form__columns">
					<div class="form__row"><label for="people-name">Name</label><input class="field" id="people-name" name="name" required maxlength="40" autocomplete="off" autocapitalize="none" spellcheck=${false} /><small>Small letters and digits; the history keeps it permanently.</small></div>
					<div class="form__row"><label for="people-role">Role</label><select class="field" id="people-role" name="role">${ROLES.map(({ name, note }) => html`<option key=${name} value=${name} defaultSelected=${name === 'reviewer'}>${name}: ${note}</option>`)}</select><small>Each role includes the rights of all roles before it in this list.</small></div>
					${mail ? html`<div class="form__row"><label for="people-email">E-mail (optional)</label><input class="field" id="people-email" name="email" type="email" maxlength="254" autocomplete="off" /><small>The link is sent there. The address is not stored.</small></div>` : null}
				</div>
				<${FormError} error=${error} />
				<p><button class="button button--primary" type="submit">${mail ? 'Invite' : 'Make a link'}</button></p>
			</form>
		</section>
	`;
}

/** @param {{one: UserJson, change: (change: {role?: Role, disabled?: boolean}) => void, link: () => void, tokens: () => void, factor: () => void, unlink: () => void}} props */
function PersonRow({ one, change, link, tokens, factor, unlink }) {
	const mine = one.name === myName.value;
	const why = mine ? 'You cannot change your own role' : undefined;
	return html`
		<tr>
			<th scope="row">${one.name}${mine ? ' (you)' : ''}<small>${cameBy(one)}</small>${one.datasets.length ? html`<small>${one.datasets.map(({ dataset, role }) => `${role} in ${dataset}`).join(', ')}</small>` : null}</th>
			<td>
				<select class="field" aria-label=${`Role of ${one.name}`} value=${one.role} disabled=${mine} title=${why} onChange=${withValue((role) => change({ role: /** @type {Role} */ (role) }))}>
					${ROLES.map(({ name }) => html`<option key=${name} value=${name}>${name}</option>`)}
				</select>
			</td>
			<td>${stateOf(one)}${one.sign_on ? html`<small>single sign-on: ${one.sign_on}</small>` : null}</td>
			<td>${one.seen ? html`<${When} at=${one.seen} />` : 'never'}</td>
			<td><span class="table__actions">
				${one.tokens ? html`<button class="button button--small" type="button" aria-label=${`Tokens of ${one.name}`} onClick=${tokens}>${plural(one.tokens, 'token')}</button>` : null}
				${one.second_factor && !mine ? html`<button class="button button--small" type="button" aria-label=${`Remove second factor of ${one.name}`} title="For a person who has lost it" onClick=${factor}>Remove second factor</button>` : null}
				${one.sign_on && !mine ? html`<button class="button button--small" type="button" aria-label=${`Unlink ${one.name}`} title="This person can then no longer log in with the account of the provider" onClick=${unlink}>Unlink</button>` : null}
				${one.disabled || mine ? null : html`<button class="button button--small" type="button" aria-label=${`New link for ${one.name}`} onClick=${link}>New link</button>`}
				<button class="button button--small ${one.disabled ? '' : 'button--danger'}" type="button" disabled=${mine} title=${why} aria-label=${`${one.disabled ? 'Enable' : 'Disable'} ${one.name}`} onClick=${() => change({ disabled: !one.disabled })}>${one.disabled ? 'Enable' : 'Disable'}</button>
			</span></td>
		</tr>
	`;
}

/** Everybody, and what can be done about them. */
function usePeople() {
	const found = useResource(() => getUsers(), []);
	const [made, setMade] = useState(/** @type {UserWithLink | null} */ (null));
	const [shown, setShown] = useState(/** @type {UserJson | null} */ (null));
	const [linked, setLinked] = useState(/** @type {UserJson | null} */ (null));
	const { error, attempt } = useAttempt();
	/** @template T @param {Promise<T>} doing @param {(done: T) => void} [then] */
	async function act(doing, then) {
		const done = await attempt(doing, then);
		found.reload();
		return done;
	}
	return { found, made, shown, linked, error, act, setMade, setShown, setLinked };
}

/** What people are in one dataset, in place of what they are in all of them. */
function InOneDataset() {
	const all = datasets.value ?? [];
	const [name, setName] = useState('');
	const chosen = name || all[0]?.name;
	if (!chosen) return null;
	return html`
		<section class="card" aria-labelledby="people-datasets">
			<h2 id="people-datasets">In one dataset</h2>
			<div class="form"><div class="form__row">
				<label for="people-dataset">Dataset</label>
				<select class="field" id="people-dataset" value=${chosen} onChange=${withValue(setName)}>
					${all.map((one) => html`<option key=${one.id} value=${one.name}>${one.name}</option>`)}
				</select>
				<small>A role here replaces the one in all datasets. Leads of a dataset can also assign roles in it.</small>
			</div></div>
		</section>
		<${MembersCard} key=${chosen} dataset=${chosen} />
	`;
}

/** What was done before there were accounts. @param {{people: UserJson[], adoptedBy: string | null, give: (id: number) => void}} props */
function LocalWork({ people, adoptedBy, give }) {
	return html`
		<section class="card" aria-labelledby="people-local">
			<h2 id="people-local">Work done before accounts existed</h2>
			${adoptedBy ? html`<p>It is assigned to ${adoptedBy}. The log keeps the name “local”.</p>` : html`
				<form class="form" onSubmit=${withForm((said) => give(Number(said.get('person'))))}>
					<div class="form__row">
						<label for="people-adopter">Assign the earlier work of “local” to</label>
						<select class="field" id="people-adopter" name="person">${people.map((one) => html`<option key=${one.id} value=${one.id}>${one.name}</option>`)}</select>
						<small>This can be done only once. The log keeps the name “local”.</small>
					</div>
					<p><button class="button" type="submit">Assign earlier work</button></p>
				</form>`}
		</section>
	`;
}

export function PeoplePage() {
	return isTeam ? html`<${People} />` : html`<${NoAccounts} current="people" title="People" />`;
}

function People() {
	const { found, made, shown, linked, error, act, setMade, setShown, setLinked } = usePeople();
	const people = found.value?.items;
	const mail = found.value?.mail ?? false;
	/** @param {UserJson} one @param {string} [email] */
	const renew = (one, email) => act(postUserLink(one.id, email), setMade);
	return html`
		<${PageFrame} current="people" title="People" where=${html`<strong>People</strong>`}>
			${found.error ? html`<${Trouble} title="The people cannot be shown" error=${found.error} retry=${found.reload} />` : null}
			${!people && !found.error ? html`<${Loading} what="people" />` : null}
			${made ? html`<${LinkCard} key=${made.link} made=${made} close=${() => setMade(null)} />` : null}
			${linked ? html`<${NewLinkCard} key=${linked.id} of=${linked} error=${error} renew=${(/** @type {string} */ email) => renew(linked, email)} close=${() => setLinked(null)} />` : null}
			${shown ? html`<${TokensCard} of=${shown} act=${act} close=${() => setShown(null)} />` : null}
			${people ? html`
				<${InviteCard} error=${error} mail=${mail} invite=${(/** @type {string} */ name, /** @type {Role} */ role, /** @type {string} */ email) => act(postUser(name, role, email), setMade)} />
				<${InviteManyCard} mail=${mail} invited=${found.reload} />
				<section class="card card--flush" aria-labelledby="people-all">
					<h2 id="people-all">All people</h2>
					<div class="table__scroll"><table class="table">
						<thead><tr><th>Name</th><th>In all datasets</th><th>State</th><th>Last seen</th><td></td></tr></thead>
						<tbody>${people.map((one) => html`
							<${PersonRow}
								key=${one.id} one=${one} tokens=${() => setShown(one)} factor=${() => act(deleteSecondFactorOf(one.id))} unlink=${() => act(deleteIdentityOf(one.id))} link=${() => (mail ? setLinked(one) : renew(one))}
								change=${(/** @type {{role?: Role, disabled?: boolean}} */ wanted) => act(patchUser(one.id, wanted))}
							/>`)}
						</tbody>
					</table></div>
					<${FactorRule} act=${act} />
				</section>
				<${MaintenanceCard} />
				<${InOneDataset} key=${String(people.length)} />
				<${LocalWork} people=${people} adoptedBy=${found.value?.adopted_by ?? null} give=${(/** @type {number} */ id) => act(postAdoption(id))} />` : null}
		<//>
	`;
}
