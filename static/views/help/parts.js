// @ts-check
/** The parts of the help, in tabs; each is fetched when it is first shown. */

import { html } from 'htm/preact';
import { useRef } from 'preact/hooks';

import { lazy } from '../../lib/lazy.js';
import { HELP_PARTS } from '../../state/palette_items.js';
import { Keys } from './keys.js';

/** @import {Binding} from '../../lib/keys.js' */

const Legend = lazy(async () => (await import('./legend.js')).Legend);
const Words = lazy(async () => (await import('./words.js')).Words);
const Guide = lazy(async () => (await import('./guide.js')).Guide);
const PracticePart = lazy(async () => (await import('./practice.js')).PracticePart);

const STEPS = /** @type {{[key: string]: number}} */ ({ ArrowRight: 1, ArrowLeft: -1 });

/** @param {{tab: string, onTab: (tab: string) => void}} props */
function Tabs({ tab, onTab }) {
	const list = useRef(/** @type {HTMLDivElement | null} */ (null));
	/** @param {KeyboardEvent} event */
	function key(event) {
		const step = STEPS[event.key];
		if (!step) return;
		const at = HELP_PARTS.findIndex(({ name }) => name === tab);
		const next = (at + step + HELP_PARTS.length) % HELP_PARTS.length;
		onTab(HELP_PARTS[next].name);
		/** @type {HTMLElement | undefined} */ (list.current?.children[next])?.focus();
		event.preventDefault();
		event.stopPropagation();
	}
	return html`
		<div class="tabs" role="tablist" aria-label="Parts of the help" ref=${list} onKeyDown=${key}>
			${HELP_PARTS.map(({ name, label }) => html`
				<button
					key=${name} id=${`help-tab-${name}`} class="tabs__tab" type="button" role="tab" aria-controls="help-panel"
					aria-selected=${name === tab} tabindex=${name === tab ? 0 : -1} onClick=${() => onTab(name)}
				>${label}</button>`)}
		</div>
	`;
}

/**
 * @param {{
 *   tab: string, onTab: (tab: string) => void, onLeave?: () => void, bindings?: readonly Binding[]
 * }} props `onLeave`: the person goes elsewhere from here
 */
export function HelpParts({ tab, onTab, onLeave = () => {}, bindings }) {
	return html`
		<${Tabs} tab=${tab} onTab=${onTab} />
		<div class="help-panel" id="help-panel" role="tabpanel" aria-labelledby=${`help-tab-${tab}`} tabindex="0">
			${tab === 'legend' ? html`<${Legend} />`
				: tab === 'words' ? html`<${Words} />`
					: tab === 'guide' ? html`<${Guide} />`
						: tab === 'practice' ? html`<${PracticePart} onLeave=${onLeave} />`
							: html`<${Keys} bindings=${bindings} />`}
		</div>
	`;
}
