// @ts-check
/** The strip below the views: balls, lines, pitch. */

import { html } from 'htm/preact';

import { stripCollapsed } from '../state/workspace.js';
import { ContactSheet } from './contact_sheet.js';
import { LineList } from './line_list.js';
import { MiniPitch } from './mini_pitch.js';

/** @import {GroupDocument, SolutionJson} from '../api/types.js' */
/** @import {ViewPicture} from '../overlays/scene.js' */

/** @param {{group: GroupDocument, solution: SolutionJson | null, pictures: ViewPicture[]}} props */
export function BottomStrip({ group, solution, pictures }) {
	return html`
		<section class="strip" data-collapsed=${stripCollapsed.value} aria-label="Details">
			<${ContactSheet} pictures=${pictures} policy=${group.policy} />
			<${LineList} pictures=${pictures} />
			<${MiniPitch} group=${group} solution=${solution} />
		</section>
	`;
}
