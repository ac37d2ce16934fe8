// @ts-check
/** What people say to each other about the group: threads, open until somebody settles them, and the notes of verdicts. */

import { html } from 'htm/preact';
import { useEffect, useRef, useState } from 'preact/hooks';

import { ApiError, sentenceOf } from '../../api/problem.js';
import { deleteComment, patchComment, patchThread, postReply, postThread } from '../../api/threads.js';
import { param } from '../../lib/router.js';
import { partsOf } from '../../state/mentions.js';
import { historyAddress } from '../../state/navigation.js';
import { complain } from '../../state/notice.js';
import { commentDraft, composing, openThreads, readThreads, threads } from '../../state/threads.js';
import { focusView } from '../../state/workspace.js';
import { ConfirmButton } from '../confirm_button.js';
import { Letter } from '../letter.js';
import { Term } from '../term.js';
import { When } from '../when.js';
import { CommentField } from './comment_field.js';

/** @import {GroupDocument} from '../../api/types.js' */
/** @import {CommentJson, ThreadJson} from '../../api/threads.js' */

/** Do something, and show what became of it. @param {number} group @param {Promise<unknown>} doing */
async function act(group, doing) {
	try {
		await doing;
	} catch (error) {
		if (!(error instanceof ApiError)) throw error;
		complain(sentenceOf(error));
	}
	await readThreads(group);
}

/** @param {{actor: string}} props */
function Who({ actor }) {
	return html`<strong>${actor === 'local' ? 'You' : actor}</strong>`;
}

/** @param {{group: number, thread: number, one: CommentJson}} props */
function Comment({ group, thread, one }) {
	const [changing, setChanging] = useState(false);
	if (changing && one.text !== null) {
		return html`<li><${CommentField}
			id=${`comment-${one.id}`} group=${group} label="Your comment" button="Save" text=${one.text} focus=${true} cancel=${() => setChanging(false)}
			send=${async (/** @type {string} */ text) => { await patchComment(group, thread, one.id, text); setChanging(false); await readThreads(group); }}
		/></li>`;
	}
	return html`
		<li>
			<p class="talk__who"><${Who} actor=${one.actor} /> <${When} at=${one.at} />${one.edited && one.text !== null ? ' · edited' : ''}
				${one.mine && one.text !== null ? html`<span class="talk__own">
					<button class="link-button" type="button" data-needs="annotate" onClick=${() => setChanging(true)}>Edit${commentDraft(group, `comment-${one.id}`) ? ' (draft)' : ''}<span class="hidden-text"> your comment</span></button>
					<${ConfirmButton} link=${true} needs="annotate" label="Delete" question="Delete for good?" what="your comment" run=${() => act(group, deleteComment(group, thread, one.id))} />
				</span>` : null}
			</p>
			${one.text === null ? html`<p class="talk__gone">Deleted by its author.</p>` : html`<p class="talk__text">${partsOf(one.text, one.mentions).map((part) => (part.mention ? html`<mark>${part.text}</mark>` : part.text))}</p>`}
		</li>
	`;
}

/** @param {{group: GroupDocument, thread: ThreadJson}} props */
function ThreadPlace({ group, thread }) {
	const view = group.views.find(({ key }) => key === thread.view);
	if (!view) return null;
	const where = thread.at ? ` ${Math.round(thread.at.x)}, ${Math.round(thread.at.y)}` : '';
	return html`<button class="link-button talk__place" type="button" onClick=${() => focusView(view.letter)}><${Letter} letter=${view.letter} />${where}<span class="hidden-text"> show that view</span></button>`;
}

/** @param {{group: GroupDocument, thread: ThreadJson}} props */
function Thread({ group, thread }) {
	const item = useRef(/** @type {HTMLLIElement | null} */ (null));
	const [replying, setReplying] = useState(false);
	const named = param('thread') === String(thread.id);
	useEffect(() => { if (named) item.current?.scrollIntoView({ block: 'nearest' }); }, [named]);
	const settled = thread.resolved !== null;
	return html`
		<li class="talk__thread" ref=${item} data-resolved=${settled} data-named=${named}>
			<${ThreadPlace} group=${group} thread=${thread} />
			<ol>${thread.comments.map((one) => html`<${Comment} key=${one.id} group=${group.id} thread=${thread.id} one=${one} />`)}</ol>
			${settled ? html`<p class="talk__gone">Resolved by ${thread.resolved_by === 'local' ? 'you' : thread.resolved_by}.</p>` : null}
			${replying ? html`<${CommentField}
				id=${`reply-${thread.id}`} group=${group.id} label="Reply" button="Reply" focus=${true} cancel=${() => setReplying(false)}
				send=${async (/** @type {string} */ text) => { await postReply(group.id, thread.id, text); setReplying(false); await readThreads(group.id); }}
			/>` : html`<p class="talk__buttons">
				<button class="button button--small" type="button" data-needs="annotate" onClick=${() => setReplying(true)}>Reply${commentDraft(group.id, `reply-${thread.id}`) ? ' (draft)' : ''}</button>
				<button class="button button--small" type="button" data-needs="annotate" onClick=${() => act(group.id, patchThread(group.id, thread.id, !settled))}>${settled ? 'Open again' : 'Resolve'}</button>
			</p>`}
		</li>
	`;
}

/** The notes of verdicts, which stand in the same place. @param {{group: GroupDocument}} props */
function VerdictNotes({ group }) {
	const noted = group.verdicts.filter(({ note }) => note);
	if (!noted.length) return null;
	return html`<ul class="talk__notes">${noted.map(({ by, at, note, state }) => html`
		<li key=${`${by} ${at}`}><p class="talk__who"><${Who} actor=${by ?? 'local'} /> <${When} at=${at} /> · ${state === 'unreviewed' ? 'note' : `note on ${state}`}</p><p class="talk__text">${note}</p></li>`)}</ul>`;
}

/** @param {{group: GroupDocument}} props */
export function CommentsCard({ group }) {
	const card = useRef(/** @type {HTMLElement | null} */ (null));
	const [all, setAll] = useState(false);
	const items = threads.value ?? [];
	const named = items.find(({ id, resolved }) => resolved && param('thread') === String(id));
	const settled = items.filter(({ resolved }) => resolved).length;
	const listed = items.filter(({ resolved }) => all || named || !resolved);
	const wish = composing.value;
	useEffect(() => { if (wish) card.current?.querySelector('.talk__new')?.scrollIntoView({ block: 'nearest' }); }, [wish]);
	const place = wish?.place ?? null;
	/** @param {string} text */
	async function say(text) {
		await postThread(group.id, place ? { text, view: place.view, at: place.at } : { text });
		composing.value = null;
		await readThreads(group.id);
	}
	return html`
		<section class="card talk" ref=${card} aria-labelledby="talk-title">
			<h2 id="talk-title"><${Term} word="thread">Comments<//>${openThreads.value ? ` · ${openThreads.value} open` : ''}
				<a class="card__more link" href=${historyAddress(group.id)}>history</a>
				${settled ? html`<button class="card__more talk__all" type="button" aria-expanded=${all} onClick=${() => setAll(!all)}>${all ? 'hide' : 'show'} ${settled} resolved</button>` : null}</h2>
			<${VerdictNotes} group=${group} />
			<ol class="talk__threads">${listed.map((thread) => html`<${Thread} key=${thread.id} group=${group} thread=${thread} />`)}</ol>
			<div class="talk__new">
				${place ? html`<p class="talk__who"><${Letter} letter=${place.letter} /> ${Math.round(place.at.x)}, ${Math.round(place.at.y)} <button class="link-button" type="button" onClick=${() => { composing.value = null; }}>about the whole group instead</button></p>` : null}
				<${CommentField} key=${group.id} id="comment-new" group=${group.id} label=${place ? `Comment at ${place.letter}` : 'Comment on this group'} button="Comment" focus=${wish?.time ?? 0} send=${say} />
			</div>
		</section>
	`;
}
