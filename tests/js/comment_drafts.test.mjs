/** A comment that is begun outlives its field. */

import assert from 'node:assert/strict';
import { it } from 'node:test';

/** @type {Map<string, string>} */
const kept = new Map();
globalThis.sessionStorage = /** @type {any} */ ({ getItem: (/** @type {string} */ key) => kept.get(key) ?? null, setItem: (/** @type {string} */ key, /** @type {string} */ text) => kept.set(key, text) });
globalThis.location = /** @type {any} */ ({ pathname: '/review/7', search: '' });

const { commentDraft, keepCommentDraft } = await import('../../static/state/threads.js');

it('keeps a draft for each group and thread until it is sent', () => {
	keepCommentDraft(7, 'comment-new', 'half a sent');
	keepCommentDraft(7, 'reply-3', 'yes, ');
	assert.equal(commentDraft(8, 'comment-new'), '');
	assert.deepEqual(JSON.parse(kept.get('touchline.comment-drafts') ?? ''), { '7 comment-new': 'half a sent', '7 reply-3': 'yes, ' });
	keepCommentDraft(7, 'comment-new', ' ');
	assert.equal(commentDraft(7, 'comment-new'), '');
	assert.equal(commentDraft(7, 'reply-3'), 'yes, ');
});
