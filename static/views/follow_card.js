// @ts-check
/** What came of following a ball: into which groups, how surely, why no further; accepted and put away here. */

import { html } from 'htm/preact';

import { plural } from '../lib/format.js';
import { group } from '../state/group.js';
import { acceptFollowed, endFollow, follow, nextUnsure, sure, unsure } from '../state/follow.js';
import { Letter } from './letter.js';
import { Term } from './term.js';

/** @import {FollowedBall} from '../api/follow.js' */

const ENDS = {
	lost: 'the ball is lost', left: 'the ball left the picture', known: 'a group has a ball already', end: 'no more groups',
	limit: 'the limit of groups is reached: follow again from the last one',
};

/** @param {{found: FollowedBall, here: number | undefined}} props */
function Strip({ found, here }) {
	return html`
		<ol class="follow__strip" aria-hidden="true">
			${found.items.map(({ view, state, group: id, frame }) => html`<li key=${view} data-state=${state} data-here=${id === here} title=${`Frame ${frame}: ${state}`}></li>`)}
		</ol>
	`;
}

/** @param {{found: FollowedBall}} props */
function Found({ found }) {
	const [certain, open] = [sure.value.length, unsure.value.length];
	const here = unsure.value.some((item) => item.group === group.value?.id);
	const why = certain ? '' : 'The remaining views are uncertain: check each, and accept it with Y';
	return html`
		<dl class="facts">
			<dt>Frames</dt><dd>${found.first} to ${found.last}</dd>
			<dt>Before</dt><dd>${ENDS[found.before]}</dd>
			<dt>After</dt><dd>${ENDS[found.after]}</dd>
		</dl>
		<${Strip} found=${found} here=${group.value?.id} />
		${found.unreadable.length ? html`<p class="note" role="note">${plural(found.unreadable.length, 'frame')} cannot be read; the ball was followed without ${found.unreadable.length === 1 ? 'it' : 'them'}: ${found.unreadable.slice(0, 5).join(', ')}${found.unreadable.length > 5 ? ', …' : ''}.</p>` : null}
		${found.sized ? null : html`<p class="note">This view has no camera: the ball is assumed to be as large as the one you clicked.</p>`}
		${open ? html`
			<p class="follow__open">${plural(open, 'uncertain view')}${open === 1 ? ' is' : ' are'} left out. <button class="link-button" type="button" onClick=${nextUnsure}>Look at the next</button>${here ? html`<br />Press <kbd>Y</kbd> to accept the one that is shown here.` : null}</p>` : null}
		<div class="follow__tools">
			<button data-needs="annotate" class="button button--primary" type="button" aria-disabled=${why !== ''} title=${why || 'One undo removes all of them (Shift+Q)'} onClick=${() => { if (!why) acceptFollowed(sure.value); }}>
				${certain ? `Accept ${plural(certain, 'ball')}` : 'Only uncertain views left'} <kbd>⇧Q</kbd>
			</button>
			<button class="button" type="button" title="Change nothing (Esc)" onClick=${endFollow}>Dismiss</button>
		</div>
	`;
}

export function FollowCard() {
	const at = follow.value;
	if (!at) return null;
	return html`
		<section class="card follow" aria-label="Followed ball" aria-busy=${at.found === null}>
			<h2><${Term} word="follow">Followed ball<//> <${Letter} letter=${at.letter} /><span class="card__aside">${at.camera}</span></h2>
			${at.found ? html`<${Found} found=${at.found} />` : html`
				<p class="note">Looking for the ball in the frames before and after…</p>
				<div class="follow__tools"><button class="button" type="button" onClick=${endFollow}>Cancel</button></div>`}
		</section>
	`;
}
