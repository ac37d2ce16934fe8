// @ts-check
/** The strip below the views: balls, lines, pitch; for static cameras the timeline too. */

import { html } from 'htm/preact';

import { useKeys } from '../lib/hooks.js';
import { lazy } from '../lib/lazy.js';
import { isStatic, stripTab } from '../state/timeline.js';
import { stripCollapsed } from '../state/workspace.js';
import { ContactSheet } from './contact_sheet.js';
import { LineList } from './line_list.js';
import { MiniPitch } from './mini_pitch.js';
import { TIMELINE_KEYS } from './timeline/keys.js';

/** @import {GroupDocument, SolutionJson} from '../api/types.js' */
/** @import {ViewPicture} from '../overlays/scene.js' */

const TABS = [{ tab: 'ball', label: 'Close-ups' }, { tab: 'timeline', label: 'Timeline' }];

/** Most groups have no timeline: what draws it is loaded when it is first shown. */
const Timeline = lazy(async () => (await import('./timeline/timeline.js')).Timeline);

function Tabs() {
	return html`
		<div class="strip__tabs" role="group" aria-label="What the strip shows">
			${TABS.map(({ tab, label }) => html`
				<button key=${tab} type="button" aria-pressed=${stripTab.value === tab} title=${`${label} (Shift+J)`} onClick=${() => { stripTab.value = tab; }}>${label}</button>`)}
		</div>
	`;
}

/** @param {{group: GroupDocument, solution: SolutionJson | null, pictures: ViewPicture[]}} props */
export function BottomStrip({ group, solution, pictures }) {
	useKeys(TIMELINE_KEYS);
	const timeline = isStatic.value && stripTab.value === 'timeline';
	return html`
		<section class="strip" data-collapsed=${stripCollapsed.value} data-tabs=${isStatic.value} data-tab=${timeline ? 'timeline' : 'ball'} aria-label="Balls, lines and pitch">
			${isStatic.value ? html`<${Tabs} />` : null}
			${timeline ? html`<${Timeline} />` : html`
				<${ContactSheet} pictures=${pictures} policy=${group.policy} />
				<${LineList} pictures=${pictures} />`}
			<${MiniPitch} group=${group} solution=${solution} />
		</section>
	`;
}
