// @ts-check
/** What predictions are worth: sets, runs, and one run with its tables and figures. */

import { html } from 'htm/preact';

import { getEvaluations, getPredictions } from '../../api/evaluations.js';
import { getVersions } from '../../api/versions.js';
import { useResource } from '../../lib/resource.js';
import { address, navigate, param } from '../../lib/router.js';
import { pageAddress } from '../dataset_menu.js';
import { datasetPage } from '../dataset_frame.js';
import { Loading, Trouble } from '../page_frame.js';
import { PredictionSets } from './prediction_sets.js';
import { RunDetails } from './run_details.js';
import { Runs } from './runs.js';

/** @import {DatasetJson} from '../../api/types.js' */

/** @param {{one: DatasetJson}} props */
function EvaluationOf({ one }) {
	const found = useResource(async (signal) => {
		const [sets, runs, versions] = await Promise.all([getPredictions(one.id, signal), getEvaluations(one.id, signal), getVersions(one.id, signal)]);
		return { sets: sets.items, runs: runs.items, versions: versions.items };
	}, [one.id]);
	if (found.error) return html`<${Trouble} title="The evaluations cannot be shown" error=${found.error} retry=${found.reload} />`;
	if (!found.value) return html`<${Loading} what="evaluations" />`;
	const { sets, runs, versions } = found.value;
	const asked = Number(param('run')) || runs[0]?.id || 0;
	/** @param {number} id */
	const show = (id) => navigate(address(pageAddress(one.name, 'evaluation'), { run: String(id) }));
	/** @param {number | null} id a run that is new; null: something else changed */
	function changed(id) {
		found.reload();
		if (id !== null) show(id);
	}
	return html`
		<div class="evaluation">
			<div class="evaluation__side">
				<${Runs} one=${one} sets=${sets} runs=${runs} versions=${versions} shown=${asked} show=${show} changed=${changed} />
				<${PredictionSets} one=${one} sets=${sets} changed=${() => changed(null)} />
			</div>
			<div class="evaluation__main">
				${asked ? html`<${RunDetails} key=${asked} id=${asked} runs=${runs} versions=${versions} changed=${() => changed(null)} />` : html`
					<section class="card empty">
						<h2>Nothing is evaluated yet</h2>
						<p>Upload the predictions of a detector or a calibrator, then evaluate them against a frozen version. Predictions never enter a solve before a person accepts them.</p>
					</section>`}
			</div>
		</div>
	`;
}

export const EvaluationPage = datasetPage('evaluation', 'Evaluation', EvaluationOf);
