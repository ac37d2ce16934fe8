// @ts-check
/** The bell in the header: how much somebody has not seen yet, and what they are told. */

import { html } from 'htm/preact';
import { useRef } from 'preact/hooks';

import { bell, seen } from '../../state/notifications.js';
import { isTeam, myName } from '../../state/me.js';
import { Popover } from '../popover.js';
import { When } from '../when.js';

/** @import {NotificationJson} from '../../api/notifications.js' */

const KINDS = { mention: '@', reply: '↩', job: '✓', assigned: '→', returned: '↶' };
const ID = 'bell';

/** Show what one is told. */
export function openNotifications() {
	// As the button does it, so that it opens below that.
	const button = /** @type {HTMLElement | null} */ (document.querySelector(`[popovertarget="${ID}"]`));
	button?.click();
}

/** @param {{items: NotificationJson[], unread: number, close: () => void}} props */
function Rings({ items, unread, close }) {
	const list = useRef(/** @type {HTMLUListElement | null} */ (null));
	/** @param {KeyboardEvent} event */
	function key(event) {
		const step = event.key === 'ArrowDown' ? 1 : event.key === 'ArrowUp' ? -1 : 0;
		const links = [...(list.current?.querySelectorAll('a') ?? [])];
		if (!step || !links.length) return;
		event.preventDefault();
		const at = links.findIndex((link) => link === document.activeElement);
		// From outside the list, up is the last one and down the first.
		links[at < 0 ? (step > 0 ? 0 : links.length - 1) : (at + step + links.length) % links.length].focus();
	}
	return html`
		<div class="bell__panel" onKeyDown=${key}>
			<h2>Notifications</h2>
			${items.length ? html`<ul class="bell__list" ref=${list}>${items.map((ring, i) => html`
				<li key=${ring.id} data-unread=${ring.read === null}>
					<a href=${ring.address} autofocus=${i === 0} onClick=${() => { if (ring.read === null) seen([ring.id]); close(); }}>
						<span class="bell__kind" aria-hidden="true">${KINDS[ring.kind] ?? '·'}</span>
						<span>${ring.read === null ? html`<span class="hidden-text">new: </span>` : null}${ring.sentence}<small>${ring.dataset ? `${ring.dataset} · ` : ''}<${When} at=${ring.at} /></small></span>
					</a>
				</li>`)}</ul>` : html`<p class="empty-note">No notifications yet. They tell you of work assigned or returned to you, mentions, replies, and finished jobs.</p>`}
			${unread ? html`<p><button class="button button--small" type="button" onClick=${() => seen(null)}>Mark all as read</button></p>` : null}
		</div>
	`;
}

export function NotificationsButton() {
	if (!isTeam || !myName.value) return null;
	const { items, unread } = bell.value ?? { items: [], unread: 0 };
	const label = html`<svg viewBox="0 0 16 16" aria-hidden="true"><path d="M3 12h10l-1.5-2V7a3.5 3.5 0 0 0-7 0v3zM6.5 14h3" /></svg><span class="hidden-text">Notifications: </span>${unread ? html`<span class="bell__count">${unread > 99 ? '99+' : unread}</span><span class="hidden-text"> new</span>` : html`<span class="hidden-text">nothing new</span>`}`;
	return html`<span class="bell"><${Popover} id=${ID} label=${label} title="Notifications (Shift B)">${(/** @type {() => void} */ close) => html`<${Rings} items=${items} unread=${unread} close=${close} />`}<//></span>`;
}
