// @ts-check
/** What the thresholds cost: sliders, funnel and curves, redrawn while one drags. */

import { html } from 'htm/preact';
import { useLayoutEffect, useRef, useState } from 'preact/hooks';

import { getPolicies, getPolicy, putPolicy } from '../api/policies.js';
import { count, words } from '../lib/format.js';
import { useResource } from '../lib/resource.js';
import { address, navigate, page, place } from '../lib/router.js';
import { loadDatasets } from '../state/datasets.js';
import { explain } from '../state/notice.js';
import { textsOf, useWhatIf, valuesIn } from '../state/what_if.js';
import { DatasetFrame } from './dataset_frame.js';
import { pageAddress } from './dataset_menu.js';
import { Funnel } from './funnel.js';
import { Loading, Trouble } from './page_frame.js';
import { SavePolicy } from './save_policy.js';
import { ThresholdForm } from './threshold_form.js';
import { VersionCard } from './version_card.js';
import { Distances, isUnmeasured, Splits, YieldCurves } from './yield_cards.js';

/** @import {PolicyField, PolicyState, ShippedPolicy, Threshold, Values, YieldJson} from '../api/policies.js' */
/** @import {DatasetJson} from '../api/types.js' */

/** Milliseconds without a change until thresholds are written into the address: browsers allow few such writes. */
const SETTLED = 250;

/** @typedef {{policy: PolicyState, etag: string, shipped: ShippedPolicy[], fields: PolicyField[]}} Loaded */

/** What changes against the saved policy. @param {{answer: YieldJson, name: string, changed: number}} props */
function Difference({ answer, name, changed }) {
	if (changed === 0) return html`<p class="yield__difference">The saved policy <strong>${name}</strong>: ${count(answer.passing)} of ${count(answer.groups)} groups pass.</p>`;
	return html`
		<div class="yield__difference" role="status">
			<p><strong>+${count(answer.gained)}</strong> ${answer.gained === 1 ? 'group' : 'groups'} and <strong>−${count(answer.lost)}</strong> against <strong>${name}</strong>: ${count(answer.passing)} pass.</p>
			${answer.needs_solving?.length ? html`<p data-grade="warn">The effect of ${answer.needs_solving.map((field) => words(field)).join(', ')} is shown only after saving and solving.</p>` : null}
		</div>
	`;
}

/**
 * Thresholds that differ from those of the saved policy. They are written into the address once they rest, so that a reload finds them; links and Back set them.
 *
 * @param {string} dataset @param {Values} present
 * @returns {[Values, (values: Values) => void]}
 */
function useValuesInAddress(dataset, present) {
	const { search } = place.value;
	const [values, setValues] = useState(() => valuesIn(search, present));
	const known = useRef(search);
	useLayoutEffect(() => {
		if (search === known.current) return;
		known.current = search;
		setValues(valuesIn(search, present));
	}, [search]);
	useLayoutEffect(() => {
		const timer = setTimeout(() => {
			const shown = page.peek();
			// The next page may be asked for and not yet drawn.
			if (shown.page !== 'yield' || shown.dataset !== dataset) return;
			navigate(address(place.peek().path, textsOf(values)), { replace: true });
			known.current = place.peek().search;
		}, SETTLED);
		return () => clearTimeout(timer);
	}, [values]);
	return [values, setValues];
}

/** @param {{one: DatasetJson, loaded: Loaded, reload: () => void}} props */
function YieldBody({ one, loaded, reload }) {
	const { policy, etag, shipped, fields } = loaded;
	const [values, setValues] = useValuesInAddress(one.name, policy.values);
	const [saving, setSaving] = useState(false);
	const { answer, error } = useWhatIf(one.id, values, policy.hash);
	const changed = Object.keys(values).length;
	const off = changed ? null : 'Nothing is changed';
	/** @param {string} name @param {Threshold} value */
	function change(name, value) {
		const { [name]: _, ...rest } = values;
		setValues(value === policy.values[name] ? rest : { ...rest, [name]: value });
	}
	const jac = Number(values.min_jac ?? policy.values.min_jac);
	const saved = () => { setValues({}); reload(); loadDatasets(); };
	return html`
		<div class="yield">
			<section class="card yield__policy" aria-labelledby="policy-title">
				<h2 id="policy-title">Policy <a class="card__aside link" href=${pageAddress(one.name, 'policy')}>${policy.name}, version ${policy.version}</a></h2>
				<p class="note">The yield is the number of groups that pass the policy. Change a threshold to see its effect; nothing changes before you save.</p>
				<${ThresholdForm} fields=${fields} shipped=${shipped} present=${policy.values} values=${values} change=${change} idle=${answer && isUnmeasured(answer) ? 'No effect: JaC was not measured' : ''} />
				${answer ? html`<${Difference} answer=${answer} name=${policy.name} changed=${changed} />` : null}
				${error ? html`<p class="form__error" role="alert">${error.message}</p>` : null}
				<p class="buttons">
					<button data-needs="lead" class="button button--fix" type="button" aria-disabled=${off !== null} title=${off ?? ''} onClick=${() => { if (off === null) setSaving(true); else explain(`${off}.`); }}>Save as policy…</button>
					<button class="button" type="button" aria-disabled=${off !== null} title=${off ?? ''} onClick=${() => { if (off === null) setValues({}); else explain(`${off}.`); }}>Reset</button>
				</p>
				${answer ? html`<${Distances} answer=${answer} />` : null}
			</section>
			<div class="yield__middle">
				${answer ? html`
					<${Funnel} answer=${answer} dataset=${one.name} linked=${changed === 0} />
					<${YieldCurves} answer=${answer} marker=${jac} />
				` : error ? null : html`<${Loading} what="the yield" />`}
			</div>
			<div class="yield__side">
				<${VersionCard} one=${one} />
				${answer ? html`<${Splits} answer=${answer} dataset=${one.name} />` : null}
			</div>
			${saving ? html`
				<${SavePolicy}
					name=${shipped.some(({ name }) => name === policy.name) ? 'custom' : policy.name} changed=${changed} onClose=${() => setSaving(false)} onSaved=${saved}
					put=${(/** @type {string} */ name) => putPolicy(one.id, name, values, etag)}
				/>` : null}
		</div>
	`;
}

/** @param {{one: DatasetJson}} props */
function YieldOf({ one }) {
	const loaded = useResource(async (signal) => {
		const [{ items, fields }, { policy, etag }] = await Promise.all([getPolicies(signal), getPolicy(one.id, signal)]);
		return { policy, etag, shipped: items, fields };
	}, [one.id]);
	if (loaded.error) return html`<${Trouble} title="The policy could not be loaded" error=${loaded.error} retry=${loaded.reload} />`;
	if (!loaded.value) return html`<${Loading} what="the policy" />`;
	return html`<${YieldBody} key=${one.id} one=${one} loaded=${loaded.value} reload=${loaded.reload} />`;
}

export function YieldPage() {
	return html`
		<${DatasetFrame} current="yield" title="Yield" where="what if">
			${(/** @type {DatasetJson} */ one) => html`<${YieldOf} one=${one} />`}
		<//>
	`;
}
