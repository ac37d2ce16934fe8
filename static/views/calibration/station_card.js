// @ts-check
/** What an edit of a static camera reaches: all its views, solved again one after the other. */

import { html } from 'htm/preact';
import { useState } from 'preact/hooks';

import { count } from '../../lib/format.js';
import { solving } from '../../state/solving.js';
import { RigDialog } from './rig_dialog.js';

/** @import {StationDetail} from '../../api/calibration.js' */
/** @import {ViewJson} from '../../api/types.js' */

/** @param {{view: ViewJson, station: StationDetail | null, dataset: {id: number, name: string}}} props */
export function StationCard({ view, station, dataset }) {
	const [adjusting, setAdjusting] = useState(false);
	if (!view.station.shared) return null;
	const work = solving.value?.dataset === dataset.name ? solving.value : null;
	const all = station ? station.groups === 1 ? 'its 1 group' : `all ${count(station.groups)} groups` : 'all groups';
	return html`
		<section class="card station-card" aria-label="Static camera">
			<h2>Static camera ${view.station.key}</h2>
			<p>Saving changes the view of this camera in <strong>${all}</strong>. This group is updated at once, the others are solved in the background.</p>
			<p><button data-needs="lead" class="button button--small" type="button" onClick=${() => setAdjusting(true)}>Adjust all static cameras…</button></p>
			${adjusting ? html`<${RigDialog} dataset=${dataset} onClose=${() => setAdjusting(false)} />` : null}
			${work ? html`
				<p class="station-card__work" role="status">
					<span>${work.sentence}${work.total ? ` ${count(work.done)} of ${count(work.total)}` : ''}</span>
					<progress max=${work.total || 1} value=${work.over ? (work.total || 1) : work.done} aria-label="Groups solved"></progress>
				</p>` : null}
		</section>
	`;
}
