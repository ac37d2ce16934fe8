// @ts-check
/** Making annotations of predictions: who accepts them says which, and sees how many. */

import { html } from 'htm/preact';
import { useEffect, useState } from 'preact/hooks';

import { acceptPredictions } from '../../api/evaluations.js';
import { sentenceOf } from '../../api/problem.js';
import { numberIn, withTick, withValue } from '../../lib/field.js';
import { count, plural, words } from '../../lib/format.js';
import { matchName } from '../../lib/match_name.js';
import { useResource } from '../../lib/resource.js';
import { resultOf } from '../../state/jobs.js';
import { reviewAddress } from '../../state/navigation.js';
import { inform } from '../../state/notice.js';
import { forgetPredictions } from '../../state/predictions.js';
import { FormDialog } from '../dialog.js';

/** @import {PredictionSet} from '../../api/evaluations.js' */
/** @import {DatasetJson} from '../../api/types.js' */

const REASONS = /** @type {{[why: string]: string}} */ ({
	annotated: 'the view has a ball already', the_same: 'the view has this ball already',
	below_score: 'the best prediction is below the score', changed_meanwhile: 'the group was changed meanwhile',
	not_a_ball: 'the box cannot be a ball of that image',
});
const EXAMPLES = 4;
/** How long a person types before it is counted, ms. */
const PAUSE = 200;

/** @param {{one: any}} props */
function Example({ one }) {
	const { name, aside } = matchName(one.group_key);
	return html`<li><a class="link" href=${reviewAddress(one.group, '')}>${name}</a><small class="note">${[`view ${one.key}`, `score ${one.score.toFixed(2)}`, aside].filter(Boolean).join(' · ')}</small></li>`;
}

/** @param {{plan: any}} props */
function Plan({ plan }) {
	const refused = Object.entries(plan.refused ?? {});
	return html`
		<div class="bulk__outcome" role="status">
			<p><strong>${count(plan.changed)}</strong> ${plan.changed === 1 ? 'view' : 'views'} of ${plural(plan.groups, 'group')} ${plan.changed === 1 ? 'gets' : 'get'} a ball.</p>
			${plan.sample.length ? html`<ul class="accept__sample">${plan.sample.slice(0, EXAMPLES).map((/** @type {any} */ one) => html`<${Example} key=${one.view} one=${one} />`)}${plan.changed > EXAMPLES ? html`<li class="note">and ${count(plan.changed - EXAMPLES)} more</li>` : null}</ul>` : null}
			${refused.length ? html`<ul>${refused.map(([why, n]) => html`<li key=${why}>${count(Number(n))} left as ${Number(n) === 1 ? 'it is' : 'they are'}: ${REASONS[why] ?? words(why)}</li>`)}</ul>` : null}
		</div>
	`;
}

/** A value once nobody has changed it for a moment. @template T @param {T} value @returns {T} */
function useSettled(value) {
	const [settled, setSettled] = useState(value);
	useEffect(() => {
		const timer = setTimeout(setSettled, PAUSE, value);
		return () => clearTimeout(timer);
	}, [value]);
	return settled;
}

/** @param {{one: DatasetJson, set: PredictionSet, onClose: () => void}} props */
export function AcceptPredictions({ one, set, onClose }) {
	const [typed, setTyped] = useState({ q: '', min_score: /** @type {number | null} */ (0.5), replace: false });
	const ask = useSettled(typed);
	const [state, setState] = useState({ busy: '', error: '' });
	const body = { dataset: one.name, predictions: set.id, ...ask, min_score: ask.min_score ?? 0 };
	const plan = useResource((signal) => (ask.min_score === null ? Promise.resolve(null) : acceptPredictions({ ...body, dry_run: true }, signal)), [ask.q, ask.min_score, ask.replace]);
	const would = plan.value?.changed ?? 0;
	const why = state.busy ? 'Under way' : plan.error ? sentenceOf(plan.error) : ask !== typed || plan.waiting ? 'Counting…' : ask.min_score === null ? 'The smallest score is empty' : would === 0 ? 'No view would get a ball' : '';
	async function send() {
		if (why) return;
		setState({ busy: 'Accepting…', error: '' });
		try {
			const done = await resultOf(await acceptPredictions({ ...body, dry_run: false }), (job) => setState({ busy: job.sentence || 'Accepting…', error: '' }));
			forgetPredictions();
			inform(`${plural(done.changed, 'view')} ${done.changed === 1 ? 'has' : 'have'} a ball from ${set.name}. Each can be undone in its group.`);
			onClose();
		} catch (error) {
			setState({ busy: '', error: sentenceOf(error) });
		}
	}
	return html`
		<${FormDialog}
			title=${`Accept balls of ${set.name}`} onClose=${onClose} onSubmit=${send}
			buttons=${html`<button class="button button--primary" type="submit" aria-disabled=${why !== ''} title=${why}>${state.busy || (would ? `Accept ${count(would)}` : 'Accept')}</button>`}
		>
			<p>The prediction with the highest score of each view becomes its annotation, as an edit that can be undone.</p>
			<div class="form__row"><label for="accept-q">Groups (a query as in the queue)</label><input class="field mono" id="accept-q" placeholder="every group; gate:ball for those without enough balls" value=${typed.q} autocomplete="off" spellcheck=${false} onInput=${withValue((text) => setTyped({ ...typed, q: text }))} /></div>
			<div class="form__row"><label for="accept-score">Smallest score</label><input class="field" id="accept-score" type="number" min="0" max="1" step="any" required defaultValue=${String(typed.min_score)} onInput=${withValue((text) => setTyped({ ...typed, min_score: numberIn(text) }))} /></div>
			<label class="form__check"><input type="checkbox" checked=${typed.replace} onChange=${withTick((replace) => setTyped({ ...typed, replace }))} />Replace existing balls</label>
			${plan.value ? html`<${Plan} plan=${plan.value} />` : null}
			${state.error || plan.error ? html`<p class="form__error" role="alert">${state.error || sentenceOf(plan.error)}</p>` : null}
		<//>
	`;
}
