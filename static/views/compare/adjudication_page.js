// @ts-check
/** A group whose annotations disagree: one is taken, or a third one begins from one of them. */

import { html } from 'htm/preact';
import { useCallback, useEffect, useMemo, useState } from 'preact/hooks';

import { getCase, getWaiting, postReturnForCorrection, postDecision } from '../../api/agreement.js';
import { ApiError, sentenceOf } from '../../api/problem.js';
import { words } from '../../lib/format.js';
import { useKeys } from '../../lib/hooks.js';
import { useResource } from '../../lib/resource.js';
import { address, navigate, page } from '../../lib/router.js';
import { comparison, show } from '../../state/compare.js';
import { question } from '../../state/return_group.js';
import { isTeam, myName } from '../../state/me.js';
import { reviewAddress } from '../../state/navigation.js';
import { announce, complain } from '../../state/notice.js';
import { NoticeBar } from '../bars.js';
import { ReturnDialog } from '../return_dialog.js';
import { Header } from '../header.js';
import { Loading, Trouble } from '../page_frame.js';
import { CompareWorkspace } from './workspace.js';

/** @import {CaseJson} from '../../api/agreement.js' */
/** @import {Binding} from '../../lib/keys.js' */

/** @param {string} dataset */
const agreementAddress = (dataset) => address(`/datasets/${encodeURIComponent(dataset)}/agreement`, {});

/** The next group that waits, or the list. @param {string} dataset @param {number} after */
async function goOn(dataset, after) {
	const { items } = await getWaiting(dataset);
	const next = items.find(({ group }) => group !== after);
	navigate(next ? `/adjudicate/${next.group}` : agreementAddress(dataset));
}

/** @param {{found: CaseJson, chosen: number | null, third: boolean, busy: boolean, decide: () => void, flipThird: () => void, back: () => void}} props */
function DecisionCard({ found, chosen, third, busy, decide, flipThird, back }) {
	const taken = chosen === null ? null : found.annotations[chosen];
	const of = found.group.dataset.name;
	const say = taken === null ? 'Compare the annotations, then choose one (keys 1, 2 …)' : third
		? `${taken.person}’s annotation is applied to the group, and you edit it further`
		: taken.verdict ? `${taken.person}’s annotation is applied to the group, with your verdict: ${words(taken.verdict)}` : `${taken.person}’s annotation is applied to the group, which then still needs a verdict`;
	return html`
		<section class="card compare__card" aria-labelledby="compare-decide">
			<h2 id="compare-decide">Decide</h2>
			${found.refused ? html`<p role="alert" data-grade="warn">${found.refused.replace(/^./, (first) => first.toUpperCase())}.</p>` : html`
				${found.own ? html`<p class="compare__own">You annotated this group yourself. No other reviewer is available, so you may decide; the history records it.</p>` : null}
				<p class="compare__say" role="status">${say}${say.endsWith('…') ? '' : '.'}</p>
				<p class="compare__links">
					<button class="button" type="button" data-needs="review" data-of=${of} aria-pressed=${third} onClick=${flipThird}>Apply, then edit <kbd>${found.annotations.length + 1}</kbd></button>
					${isTeam ? html`<button class="button" type="button" data-needs="review" data-of=${of} disabled=${taken === null} title=${taken === null ? 'Choose one first' : 'Return it to its annotator, to be changed and submitted again'} onClick=${back}>Return… <kbd>⇧U</kbd></button>` : null}
					<button class="button button--primary" type="button" data-needs="review" data-of=${of} disabled=${taken === null || busy} title=${taken === null ? 'Choose one first' : ''} onClick=${decide}>Decide <kbd>Enter</kbd></button>
				</p>`}
			<p class="compare__verdicts">${found.annotations.map(({ id, person, verdict }) => html`<span key=${id}>${person}: <strong>${words(verdict ?? 'no verdict')}</strong></span>`)}</p>
		</section>
	`;
}

/** @param {{found: CaseJson}} props */
function Adjudication({ found }) {
	const [chosen, setChosen] = useState(/** @type {number | null} */ (null));
	const [third, setThird] = useState(false);
	const [busy, setBusy] = useState(false);
	const { group, annotations, refused } = found;

	const choose = useCallback((/** @type {number} */ place) => {
		if (place >= annotations.length) return;
		setChosen(place);
		announce(`${annotations[place].person}’s annotation is chosen. Enter decides.`);
	}, [annotations]);
	const decide = useCallback(async () => {
		if (chosen === null || refused || busy) return;
		setBusy(true);
		try {
			await postDecision(group.id, annotations[chosen].id, third);
			if (third) navigate(reviewAddress(group.id));
			else await goOn(group.dataset.name, group.id);
		} catch (error) {
			if (!(error instanceof ApiError)) throw error;
			complain(`Not decided: ${sentenceOf(error)}`);
		} finally {
			setBusy(false);
		}
	}, [chosen, third, refused, busy, group, annotations]);
	const flipThird = useCallback(() => setThird((on) => !on), []);
	const back = useCallback(() => {
		const take = chosen === null ? null : annotations[chosen];
		if (!take || refused || !isTeam) return;
		const mine = take.person === myName.value;
		question.value = {
			kind: 'back', person: mine ? 'yourself' : take.person,
			says: `${mine ? 'You' : take.person} can change it and submit it again. Then the annotations are compared again; if all agree, no decision is needed.`,
			send: async (reason) => {
				await postReturnForCorrection(group.id, take.id, reason);
				announce(`The annotation was returned to ${take.person}.`);
				await goOn(group.dataset.name, group.id);
			},
		};
	}, [chosen, refused, group, annotations]);
	// The key after the last annotation's.
	const keys = useMemo(() => /** @type {Binding[]} */ ([
		...annotations.map((_, place) => ({
			keys: [String(place + 1)], label: 'Choose that annotation', group: 'Decide', shown: place === 0 ? `1 … ${annotations.length}` : 'hidden',
			needs: /** @type {const} */ ('review'), run: () => choose(place),
		})),
		{ keys: [String(annotations.length + 1)], label: 'Apply the chosen annotation and edit it further', group: 'Decide', needs: 'review', run: flipThird },
		{ keys: ['Enter'], label: 'Decide', group: 'Decide', needs: 'review', run: decide },
		{ keys: ['Shift+u'], label: 'Return the chosen one to its annotator, with a reason', group: 'Decide', needs: 'review', run: back },
		{ keys: ['Escape'], label: 'Back to the list', group: 'Decide', run: () => navigate(agreementAddress(group.dataset.name)) },
	]), [annotations, choose, decide, flipThird, back, group]);
	useKeys(keys);
	useEffect(() => {
		show(found.comparison);
		return () => { comparison.value = null; };
	}, [found]);
	if (!comparison.value) return null;
	return html`
		<${CompareWorkspace}
			names=${annotations.map(({ person }) => person)} images=${new Map(group.views.map((view) => [view.key, view.image]))}
			chosen=${chosen} choose=${refused ? null : choose}
		><${DecisionCard} found=${found} chosen=${chosen} third=${third} busy=${busy} decide=${decide} flipThird=${flipThird} back=${back} /><//>
		${question.value ? html`<${ReturnDialog} />` : null}
	`;
}

export function AdjudicationPage() {
	const group = page.value.page === 'adjudicate' ? page.value.group : null;
	const found = useResource((signal) => (group === null ? Promise.resolve(null) : getCase(group, signal)), [group]);
	const ready = found.value !== null && found.value.group.id === group ? found.value : null;
	useEffect(() => { document.title = ready ? `Decide: ${ready.group.label} · Touchline` : 'Touchline'; }, [ready]);
	return html`
		<div class="compare">
			<${Header} current="adjudicate" of=${ready?.group.dataset.name}>
				<div class="header__middle"><span class="header__where">
					${ready ? html`<a class="button" href=${agreementAddress(ready.group.dataset.name)} title="Back to the list (Esc)">‹ Agreement</a> ${ready.group.label}` : ''}
				</span></div>
			<//>
			<div class="bars"><${NoticeBar} /></div>
			${ready ? html`<${Adjudication} key=${ready.group.id} found=${ready} />` : html`
				<main class="page__main">${found.error
					? html`<${Trouble} title="There is nothing to decide here" error=${found.error} retry=${found.reload} />`
					: html`<${Loading} what="the annotations" />`}</main>`}
		</div>
	`;
}
