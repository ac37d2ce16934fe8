// @ts-check
/** The audit: who said and did what, in the datasets that one leads. */

import { html } from 'htm/preact';
import { useEffect, useLayoutEffect, useRef, useState } from 'preact/hooks';

import { auditFile, getAudit } from '../../api/history.js';
import { ApiError } from '../../api/problem.js';
import { beginningOf } from '../../lib/day.js';
import { withForm } from '../../lib/field.js';
import { address, navigate, param } from '../../lib/router.js';
import { datasets } from '../../state/datasets.js';
import { Loading, PageFrame, Trouble } from '../page_frame.js';
import { When } from '../when.js';

/** @import {AuditEntryJson, AuditFilter} from '../../api/history.js' */

const FAMILIES = [
	{ name: 'edit', label: 'edits' }, { name: 'verdict', label: 'verdicts' }, { name: 'comment', label: 'comments' }, { name: 'policy', label: 'policies' },
	{ name: 'version', label: 'versions' }, { name: 'import', label: 'imports' }, { name: 'people', label: 'people, rights, tokens, logins' }, { name: 'job', label: 'jobs' }, { name: 'work', label: 'batches, independent annotations, gold groups' }, { name: 'other', label: 'other' },
];
/** Pages of what belongs to no dataset. */
const PLACES = /** @type {Record<string, string>} */ ({ people: 'People', job: 'Jobs' });
const FIELDS = /** @type {const} */ (['q', 'person', 'family', 'dataset', 'since', 'until']);

/** What the address asks for. @returns {AuditFilter} */
function asked() {
	const found = Object.fromEntries([...FIELDS, 'group'].map((name) => [name, param(name)]).filter(([, value]) => value));
	// A day ends when the next one begins.
	if (found.until) found.until = beginningOf(found.until, 1);
	if (found.since) found.since = beginningOf(found.since);
	return found;
}

/** Entries, a page at a time. @param {AuditFilter} filter @param {string} key */
function useAudit(filter, key) {
	const [found, setFound] = useState(/** @type {{items: AuditEntryJson[], next: string | null} | null} */ (null));
	const [error, setError] = useState(/** @type {ApiError | null} */ (null));
	const [waiting, setWaiting] = useState(true);
	const asking = useRef(new AbortController());
	/** @param {string | null} cursor */
	async function read(cursor) {
		const { signal } = asking.current;
		setWaiting(true);
		try {
			const more = await getAudit(filter, cursor, signal);
			setFound((known) => ({ items: cursor === null ? more.items : [...(known?.items ?? []), ...more.items], next: more.next }));
			setError(null);
		} catch (problem) {
			if (signal.aborted) return;
			if (!(problem instanceof ApiError)) throw problem;
			setError(problem);
		}
		setWaiting(false);
	}
	useEffect(() => {
		asking.current = new AbortController();
		read(null);
		// Also what was asked for more of the former filter: its rows are none of this one.
		return () => asking.current.abort();
	}, [key]);
	return { found, error, waiting, retry: () => read(null), more: () => read(found?.next ?? null) };
}

/** @param {{one: AuditEntryJson}} props */
function Row({ one }) {
	const about = one.group ?? one.dataset ?? PLACES[one.family];
	return html`
		<tr>
			<td><${When} at=${one.at} /><small>${new Date(one.at).toLocaleString('en-GB')}</small></td>
			<th scope="row">${one.actor}${one.network ? html`<small>${one.network}</small>` : null}</th>
			<td class="past__sentence">${one.sentence}</td>
			<td>${one.address ? html`<a href=${one.address}>${about ?? 'its page'}<span class="hidden-text">: entry ${one.id}</span></a>` : about ?? '–'}${one.group && one.dataset ? html`<small>${one.dataset}</small>` : null}</td>
		</tr>
	`;
}

/** @param {{name: string, label: string, type: string}} props */
function Field({ name, label, type }) {
	return html`<div class="form__row"><label for=${`audit-${name}`}>${label}</label><input class="field" id=${`audit-${name}`} name=${name} type=${type} defaultValue=${param(name)} autocomplete="off" /></div>`;
}

/** @param {{name: string, label: string, all: string, options: {name: string, label: string}[]}} props */
function Choice({ name, label, all, options }) {
	return html`<div class="form__row"><label for=${`audit-${name}`}>${label}</label>
		<select class="field" id=${`audit-${name}`} name=${name} value=${param(name)}><option value="">${all}</option>${options.map((one) => html`<option key=${one.name} value=${one.name}>${one.label}</option>`)}</select></div>`;
}

function Filters() {
	const form = useRef(/** @type {HTMLFormElement | null} */ (null));
	const shown = FIELDS.map(param);
	// Also where the address was changed by the browser's Back, or a link. The fields stay, and so does the keyboard in them.
	useLayoutEffect(() => FIELDS.forEach((name, index) => {
		const field = /** @type {HTMLInputElement | HTMLSelectElement} */ (form.current?.elements.namedItem(name));
		if (field.value !== shown[index]) field.value = shown[index];
	}), shown);
	const choose = withForm((said) => {
		const chosen = FIELDS.map((name) => [name, String(said.get(name) ?? '')]);
		if (chosen.some(([name, value]) => value !== param(name))) navigate(address('/audit', Object.fromEntries(chosen)));
	});
	/** Words and days are taken when they are complete: a day being typed is a day with each digit. @param {FocusEvent} event */
	function leave(event) {
		if (event.target instanceof HTMLInputElement && event.target.checkValidity()) choose(event);
	}
	/** @param {Event} event */
	function change(event) {
		if (event.target instanceof HTMLSelectElement) choose(event);
	}
	return html`
		<form class="form audit__filters" ref=${form} onSubmit=${choose} onChange=${change} onFocusOut=${leave} role="search" aria-label="What is shown">
			<${Field} name="q" label="Words" type="search" />
			<${Field} name="person" label="Person" type="text" />
			<${Choice} name="family" label="What" all="everything" options=${FAMILIES} />
			<${Choice} key=${datasets.value?.length} name="dataset" label="Dataset" all="all" options=${(datasets.value ?? []).map(({ name }) => ({ name, label: name }))} />
			<${Field} name="since" label="From" type="date" />
			<${Field} name="until" label="Until" type="date" />
			<button class="button" type="submit">Show</button>
		</form>
	`;
}

export function AuditPage() {
	const filter = asked();
	const key = JSON.stringify(filter);
	const { found, error, waiting, retry, more } = useAudit(filter, key);
	const where = 'Audit';
	return html`
		<${PageFrame} current="audit" title="Audit" where=${html`<strong>${where}</strong>`}>
			<section class="card" aria-labelledby="audit-title">
				<h2 id="audit-title">Who did what
					<span class="card__aside buttons"><a class="button button--small" href=${auditFile(filter, 'csv')} download>CSV</a><a class="button button--small" href=${auditFile(filter, 'jsonl')} download>JSON Lines</a></span></h2>
				<${Filters} />
				${param('group') ? html`<p>Only group ${param('group')}. <a class="link" href="/audit">Show all</a></p>` : null}
			</section>
			${error ? html`<${Trouble} title="The audit cannot be shown" error=${error} retry=${retry} />` : null}
			${!found && !error ? html`<${Loading} what="the log" />` : null}
			${found ? html`
				<section class="card card--flush" aria-label="Entries">
					<div class="table__scroll" tabindex="0" role="group" aria-label="Entries"><table class="table audit__entries">
						<thead><tr><th>When</th><th>Who</th><th>What</th><th>About</th></tr></thead>
						<tbody>${found.items.map((one) => html`<${Row} key=${one.id} one=${one} />`)}</tbody>
					</table></div>
					${found.items.length ? null : html`<p class="empty-note audit__none">No entry matches${found.next ? ' so far' : ''}.</p>`}
					${found.next ? html`<p class="audit__more"><button class="button" type="button" aria-disabled=${waiting} onClick=${() => { if (!waiting) more(); }}>Show more</button></p>` : null}
				</section>` : null}
		<//>
	`;
}
