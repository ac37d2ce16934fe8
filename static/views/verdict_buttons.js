// @ts-check
/** Accept, reject with a reason, defer: buttons, with what they ask beside them. */

import { html } from 'htm/preact';
import { useLayoutEffect, useMemo, useRef } from 'preact/hooks';

import { withValue } from '../lib/field.js';
import { plural } from '../lib/format.js';
import { useKeys } from '../lib/hooks.js';
import { navigate } from '../lib/router.js';
import { doubt, suggestedReason } from '../state/advice.js';
import { editorAddress } from '../state/editor_address.js';
import { frozen } from '../state/return_group.js';
import { REASONS } from '../state/reasons.js';
import {
	accept, acceptAsSaved, answer, askReason, cancelAsking, defer, isBlind, lastReason, reject, rejectView, rejectViewBecause,
} from '../state/verdicts.js';
import { stagedIn } from '../state/staging.js';
import { commentDraft, keepCommentDraft } from '../state/threads.js';
import { asking, focused } from '../state/workspace.js';
import { SubmitButton } from './lease_bar.js';
import { SwapAsk } from './swap_ask.js';

/** @import {GroupDocument} from '../api/types.js' */

/**
 * The keys of a list of reasons.
 *
 * @param {string} verb @param {string} again key for the last reason
 * @param {(reason: string) => void} choose
 * @returns {import('../lib/keys.js').Binding[]}
 */
function reasonKeys(verb, again, choose) {
	return [
		...REASONS.map(({ name, label }, i) => ({
			keys: [String(i + 1)], label: `${verb}: ${label.toLowerCase()}`, group: 'Verdict', run: () => choose(name),
		})),
		{
			keys: [again], label: `${verb} with the last reason`, group: 'Verdict',
			when: () => lastReason.value !== null, run: () => choose(lastReason.value ?? 'other'),
		},
	];
}

const GROUP_REASONS = { title: 'Reject because', choose: reject, again: 'X', keys: reasonKeys('Reject', 'x', reject) };
const VIEW_REASONS = {
	title: 'Leave this view out because', choose: rejectView, again: 'Shift X', keys: reasonKeys('Leave out', 'Shift+x', rejectView),
};

/** @param {typeof GROUP_REASONS & {suggested?: string | null}} props */
function ReasonList({ title, choose, again, keys, suggested = null }) {
	// The key that would repeat the last reason takes the one that fits, where one does.
	const repeated = suggested ?? lastReason.value;
	useKeys(useMemo(() => (suggested === null ? keys : [{
		keys: ['Enter', ...keys[keys.length - 1].keys], label: `${title}: the suggested reason`, group: 'Verdict', run: () => choose(suggested),
	}, ...keys.slice(0, -1)]), [keys, suggested]));
	return html`
		<section class="ask" aria-label=${title}>
			<p class="ask__title">${title} <kbd>Esc</kbd></p>
			<ol class="reasons">
				${REASONS.map(({ name, label }, i) => html`
					<li key=${name}>
						<button type="button" data-last=${name === repeated} data-suggested=${name === suggested} onClick=${() => choose(name)}>
							<kbd>${i + 1}</kbd> ${label} ${name === suggested ? html`<span class="reasons__suggested">suggested <kbd>Enter</kbd></span>` : null} ${name === repeated ? html`<kbd>${again}</kbd>` : null}
						</button>
					</li>
				`)}
			</ol>
		</section>
	`;
}

/** @param {{group: number, title: string, button: string, onNote?: (note: string) => void}} props */
function NoteForm({ group, title, button, onNote = answer }) {
	const draft = `verdict-note ${asking.value}${asking.value === 'viewNote' ? ` ${focused.value}` : ''}`;
	const field = useRef(/** @type {HTMLInputElement | null} */ (null));
	// Before the next key: who types at once must not find the letters doing something else.
	useLayoutEffect(() => field.current?.focus(), []);
	/** @param {SubmitEvent} event */
	function send(event) {
		event.preventDefault();
		const note = field.current?.value.trim();
		if (!note) {
			field.current?.focus();
			return;
		}
		keepCommentDraft(group, draft, '');
		onNote(note);
	}
	/** @param {KeyboardEvent} event */
	function key(event) {
		if (event.key === 'Escape') cancelAsking();
	}
	return html`
		<form class="ask" onSubmit=${send} onKeyDown=${key}>
			<label class="ask__title" for="verdict-note">${title}</label>
			<input id="verdict-note" class="field" ref=${field} maxlength="500" autocomplete="off" required defaultValue=${commentDraft(group, draft)} onInput=${withValue((text) => keepCommentDraft(group, draft, text))} />
			<p class="ask__buttons">
				<button class="button button--primary" type="submit">${button} <kbd>Enter</kbd></button>
				<button class="button" type="button" onClick=${cancelAsking}>Cancel <kbd>Esc</kbd></button>
			</p>
		</form>
	`;
}

/** Before a group is accepted without what is staged in the calibration editor. @param {{group: GroupDocument}} props */
function StagedAsk({ group }) {
	const { count, view } = stagedIn(group);
	const open = () => navigate(editorAddress(group.id, view ?? ''));
	const first = useRef(/** @type {HTMLButtonElement | null} */ (null));
	// Enter means what it says also after a click on Accept.
	useLayoutEffect(() => first.current?.focus(), []);
	useKeys(useMemo(() => [
		{ keys: ['Enter'], label: 'Open the calibration editor', group: 'Verdict', run: open },
		{ keys: ['m'], label: 'Accept without what is staged', group: 'Verdict', run: acceptAsSaved },
	], [group.id, view]));
	const title = `${plural(count, 'marking')} staged in the calibration editor, not saved. Accept the group without ${count === 1 ? 'it' : 'them'}?`;
	return html`
		<section class="ask" aria-label=${title}>
			<p class="ask__title">${title} <kbd>Esc</kbd></p>
			<p class="ask__buttons">
				<button class="button button--primary" type="button" ref=${first} onClick=${open}>Open the editor <kbd>Enter</kbd></button>
				<button class="button" type="button" onClick=${acceptAsSaved}>Accept anyway <kbd>M</kbd></button>
			</p>
		</section>
	`;
}

/** What speaks against accepting a group. @param {GroupDocument} group */
function acceptTitle(group) {
	const failing = group.solution?.first_failing;
	const staged = stagedIn(group).count;
	const reasons = [
		group.solution?.passes ? '' : failing ? `a gate fails (${failing.sentence})` : 'a gate fails',
		isBlind(group) ? 'no view has a picture to look at' : '',
		staged ? `${plural(staged, 'marking')} ${staged === 1 ? 'is' : 'are'} staged and not saved` : '',
		doubt(group.solution)?.replace(/\.$/, '') ?? '',
	].filter(Boolean);
	return `Accept although ${reasons.join(' and ')}? Say why.`;
}

/** @param {{group: GroupDocument}} props */
function Ask({ group }) {
	if (asking.value === 'reason') return html`<${ReasonList} key="group" ...${GROUP_REASONS} suggested=${suggestedReason(group.solution)} />`;
	if (asking.value === 'view') return html`<${ReasonList} key="view" ...${VIEW_REASONS} />`;
	if (asking.value === 'viewNote') return html`<${NoteForm} key=${`view ${focused.value}`} group=${group.id} title="Why is this view left out?" button="Leave out" onNote=${rejectViewBecause} />`;
	if (asking.value === 'note') return html`<${NoteForm} key="reject" group=${group.id} title="What is wrong with this group?" button="Reject" />`;
	if (asking.value === 'staged') return html`<${StagedAsk} group=${group} />`;
	if (asking.value === 'swap') return html`<${SwapAsk} group=${group} />`;
	if (asking.value !== 'override') return null;
	return html`<${NoteForm} key="accept" group=${group.id} title=${acceptTitle(group)} button="Accept" />`;
}

/** @param {{group: GroupDocument}} props */
export function VerdictButtons({ group }) {
	const unsolved = group.solution === null;
	const why = frozen.value;
	return html`
		<div class="verdicts">
			<${Ask} group=${group} />
			<${SubmitButton} />
			<div class="verdicts__buttons">
				<button
					class="button button--accept" type="button" data-needs="review" onClick=${accept}
					aria-disabled=${unsolved || why !== ''} title=${why || (unsolved ? 'This group is not solved yet' : 'Accept and go to the next group')}
				>Accept <kbd>A</kbd></button>
				<button class="button button--reject" type="button" data-needs="review" aria-disabled=${why !== ''} title=${why || undefined} aria-expanded=${asking.value === 'reason'} onClick=${askReason}>Reject <kbd>X</kbd></button>
				<button class="button" type="button" data-needs="review" aria-disabled=${why !== ''} title=${why || undefined} onClick=${defer}>Defer <kbd>S</kbd></button>
			</div>
		</div>
	`;
}
