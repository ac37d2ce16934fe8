// @ts-check
/** Who works in a dataset: what everybody is there, given by its leads and by admins. */

import { html } from 'htm/preact';

import { getMembers, putMember } from '../api/people.js';
import { useAttempt } from '../lib/attempt.js';
import { withValue } from '../lib/field.js';
import { useResource } from '../lib/resource.js';
import { isTeam, myName } from '../state/me.js';
import { whyNot } from '../state/rights.js';
import { FormError } from './form_error.js';

/** @import {MemberJson, Role} from '../api/people.js' */

/** Roles that are of a dataset. */
const ROLES_HERE = /** @type {const} */ (['none', 'viewer', 'annotator', 'reviewer', 'lead']);

/** @param {{one: MemberJson, give: (role: Role | null) => void}} props */
function MemberRow({ one, give }) {
	const mine = one.name === myName.value;
	const admin = one.everywhere === 'admin';
	const why = mine ? 'You cannot change your own role' : admin ? 'An admin may do everything in every dataset' : undefined;
	return html`
		<tr>
			<th scope="row">${one.name}${mine ? ' (you)' : ''}</th>
			<td>
				<select class="field" aria-label=${`Role of ${one.name} here`} value=${one.single ?? ''} disabled=${why !== undefined} title=${why} onChange=${withValue((role) => give(/** @type {Role} */ (role) || null))}>
					<option value="">${one.everywhere}, as in all datasets</option>
					${ROLES_HERE.map((role) => html`<option key=${role} value=${role}>${role}${role === 'none' ? ': does not see it' : ' here'}</option>`)}
				</select>
			</td>
		</tr>
	`;
}

/** @param {{dataset: string}} props name of the dataset */
export function MembersCard({ dataset }) {
	const may = isTeam && whyNot('lead', dataset) === '';
	const people = useResource(async (signal) => (may && !signal.aborted ? getMembers(dataset) : { items: [] }), [dataset, may]);
	const { error, attempt } = useAttempt();
	/** @param {MemberJson} one @param {Role | null} role */
	const give = (one, role) => attempt(putMember(dataset, one.id, role)).then(people.reload);
	if (!may) return null;
	return html`
		<section class="card card--flush" aria-labelledby="members-title">
			<h2 id="members-title">Members of ${dataset}</h2>
			${people.error ? html`<${FormError} error=${people.error} />` : null}
			${error ? html`<${FormError} error=${error} />` : null}
			<div class="table__scroll"><table class="table">
				<thead><tr><th>Name</th><th>Role here</th></tr></thead>
				<tbody>${people.value?.items.map((one) => html`<${MemberRow} key=${one.id} one=${one} give=${(/** @type {Role | null} */ role) => give(one, role)} />`)}</tbody>
			</table></div>
		</section>
	`;
}
