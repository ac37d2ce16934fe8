// @ts-check
/** Starts the browser application. */

import { effect, untracked } from '@preact/signals';

import { html, render } from 'htm/preact';

import { beginsAt } from './api/events.js';
import { startKeys } from './lib/keys.js';
import { page, startRouter } from './lib/router.js';
import { startArrivals } from './state/arrival.js';
import { draft } from './state/group.js';
import { startInsight } from './state/insight.js';
import { startLeases } from './state/leases.js';
import { startLive } from './state/live.js';
import { loadSession, isTeam, me, startRights } from './state/me.js';
import { startMaintenance } from './state/maintenance.js';
import { startSuggestions } from './state/suggestions.js';
import { lasting, outbox } from './state/outbox.js';
import { startNotifications } from './state/notifications.js';
import { changesOf, stagings } from './state/staging.js';
import { startThreads } from './state/threads.js';
import { startSending } from './state/sending.js';
import { refuses } from './state/rights.js';
import { App } from './views/app.js';
import { datasetHere, startNeeds } from './views/needs.js';

addEventListener('beforeunload', (event) => {
	// What is in the outbox comes back with the page, what is in hand does not; a closed tab loses what is staged.
	const isStaged = ['review', 'calibration'].includes(page.value.page) && Object.values(stagings.value).some((one) => Object.keys(changesOf(one)).length > 0);
	if (draft.value || isStaged || (!lasting.value && outbox.value.length > 0)) event.preventDefault();
});

/** What asks the server by itself. */
function startWork() {
	startArrivals();
	startLeases();
	startSending();
	startInsight();
	startSuggestions();
	startLive();
	startThreads();
	startNotifications();
	startRights();
	startMaintenance();
}

startRouter();
startKeys((needs) => refuses(needs, datasetHere()));
startNeeds();
if (isTeam) {
	beginsAt((await loadSession())?.moment);
	let begun = false;
	effect(() => {
		if (!me.value || me.value.enrol || begun) return;
		begun = true;
		untracked(startWork);
	});
} else {
	startWork();
}
render(html`<${App} />`, /** @type {HTMLElement} */ (document.querySelector('.app')));
