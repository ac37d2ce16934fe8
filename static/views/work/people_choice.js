// @ts-check
/** Who annotates and who reviews a batch: ticks beside the names of those who may. */

import { html } from 'htm/preact';
import { useState } from 'preact/hooks';

import { getMembers } from '../../api/people.js';
import { withTick } from '../../lib/field.js';
import { useResource } from '../../lib/resource.js';
import { isTeam } from '../../state/me.js';

/** @import {Part} from '../../api/work.js' */
/** @import {MemberJson, Role} from '../../api/people.js' */

/** @typedef {Record<Part, string[]>} Chosen */

const PARTS = /** @type {{part: Part, title: string, note: string, roles: Role[]}[]} */ ([
	{ part: 'annotator', title: 'Annotators', note: 'None: groups go directly to the reviewers.', roles: ['annotator', 'reviewer', 'lead', 'admin'] },
	{ part: 'reviewer', title: 'Reviewers', note: 'None: every reviewer of this dataset.', roles: ['reviewer', 'lead', 'admin'] },
]);

/** @param {{dataset: string, chosen: Chosen, choose: (chosen: Chosen) => void, parts?: Part[]}} props `dataset`: its name; `parts`: what there is to do, else all */
export function PeopleChoice({ dataset, chosen, choose, parts }) {
	const people = useResource(async (signal) => (isTeam && !signal.aborted ? getMembers(dataset) : { items: /** @type {MemberJson[]} */ ([]) }), [dataset]);
	// Who was chosen and may no longer do it stays to be seen, also once unticked.
	const [before] = useState(chosen);
	if (!isTeam) return html`<p class="note">This server has no accounts: the batch is assigned to you.</p>`;
	/** @param {Part} part @param {string} name @param {boolean} on */
	function turn(part, name, on) {
		choose({ ...chosen, [part]: on ? [...chosen[part], name] : chosen[part].filter((one) => one !== name) });
	}
	const members = people.value?.items ?? [];
	/** The names to choose from, and those of before who cannot be chosen anew. @param {Part} part @param {Role[]} roles @returns {[name: string, why: string][]} */
	function namesOf(part, roles) {
		const able = members.filter(({ role }) => roles.includes(role)).map(({ name }) => name);
		const left = people.value ? before[part].filter((name) => !able.includes(name)) : [];
		return [
			...able.map((name) => /** @type {[string, string]} */ ([name, ''])),
			...left.map((name) => /** @type {[string, string]} */ ([name, members.some((one) => one.name === name) ? ` (no longer ${part === 'annotator' ? 'an annotator' : 'a reviewer'})` : ' (disabled)'])),
		];
	}
	return html`${PARTS.filter((one) => !parts || parts.includes(one.part)).map(({ part, title, note, roles }) => html`
		<fieldset class="people-choice" key=${part}>
			<legend>${title}</legend>
			<p class="note">${note}</p>
			<div class="people-choice__names">
				${namesOf(part, roles).map(([name, why]) => html`
					<label key=${name}><input type="checkbox" checked=${chosen[part].includes(name)} onChange=${withTick((ticked) => turn(part, name, ticked))} /> ${name}${why}</label>`)}
			</div>
		</fieldset>`)}`;
}
