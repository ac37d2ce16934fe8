// @ts-check
/** Pages that are fetched when somebody goes there: the review screen does not wait for them. */

import { html } from 'htm/preact';
import { useEffect, useState } from 'preact/hooks';

import { Header } from './header.js';

/** @import {ComponentType} from 'preact' */

/** @type {{[page: string]: () => Promise<ComponentType>}} */
const LOADERS = {
	queue: async () => (await import('./queue_page.js')).QueuePage,
	calibration: async () => (await import('./calibration/calibration_page.js')).CalibrationPage,
	compare: async () => (await import('./compare/compare_page.js')).ComparePage,
	adjudicate: async () => (await import('./compare/adjudication_page.js')).AdjudicationPage,
	agreement: async () => (await import('./compare/agreement_page.js')).AgreementPage,
	datasets: async () => (await import('./datasets_page.js')).DatasetsPage,
	yield: async () => (await import('./yield_page.js')).YieldPage,
	policy: async () => (await import('./policy_page.js')).PolicyPage,
	statistics: async () => (await import('./statistics_page.js')).StatisticsPage,
	versions: async () => (await import('./versions_page.js')).VersionsPage,
	evaluation: async () => (await import('./evaluation/evaluation_page.js')).EvaluationPage,
	exports: async () => (await import('./exports_page.js')).ExportsPage,
	recordings: async () => (await import('./recordings/recordings_page.js')).RecordingsPage,
	recording: async () => (await import('./recordings/recording_page.js')).RecordingPage,
	link: async () => (await import('./recordings/link_page.js')).LinkPage,
	tracks: async () => (await import('./tracks/tracks_page.js')).TracksPage,
	track: async () => (await import('./tracks/track_page.js')).TrackPage,
	import: async () => (await import('./import_page.js')).ImportPage,
	help: async () => (await import('./help/help_page.js')).HelpPage,
	account: async () => (await import('./account_page.js')).AccountPage,
	people: async () => (await import('./people_page.js')).PeoplePage,
	login: async () => (await import('./sign_on_page.js')).SignOnPage,
	join: async () => (await import('./join_page.js')).JoinPage,
	work: async () => (await import('./work/work_page.js')).WorkPage,
	history: async () => (await import('./history/history_page.js')).HistoryPage,
	audit: async () => (await import('./history/audit_page.js')).AuditPage,
	jobs: async () => (await import('./jobs_page.js')).JobsPage,
};

/** @type {Map<string, ComponentType>} */
const loaded = new Map();

/** Fetch a page's code, once. @param {string} name @returns {Promise<ComponentType>} */
export async function loadPage(name) {
	const known = loaded.get(name);
	if (known) return known;
	const View = await LOADERS[name]();
	loaded.set(name, View);
	return View;
}

/** @param {{name: string, failed: boolean}} props */
function Waiting({ name, failed }) {
	return html`
		<div class="page">
			<${Header} current=${name} />
			<main class="page__main">
				${failed ? html`
					<section class="card empty" role="alert">
						<h1>This page could not be loaded</h1>
						<p>The server cannot be reached. Is it still running?</p>
						<p><button class="button" type="button" onClick=${() => location.reload()}>Load again</button></p>
					</section>` : null}
			</main>
		</div>
	`;
}

/** @param {{name: string}} props */
export function LazyPage({ name }) {
	const [failed, setFailed] = useState('');
	const [, setArrived] = useState('');
	useEffect(() => {
		loadPage(name).then(() => setArrived(name), () => setFailed(name));
	}, [name]);
	const View = loaded.get(name);
	// The key: another page starts afresh, even where two are built alike.
	return View ? html`<${View} key=${name} />` : html`<${Waiting} name=${name} failed=${failed === name} />`;
}
