// @ts-check
/** Starts the browser application. */

import '@preact/signals';

import { html, render } from 'htm/preact';

import { startKeys } from './lib/keys.js';
import { startRouter } from './lib/router.js';
import { startArrivals } from './state/arrival.js';
import { unsaved } from './state/group.js';
import { App } from './views/app.js';

addEventListener('beforeunload', (event) => {
	if (unsaved.value > 0) event.preventDefault();
});
startRouter();
startArrivals();
startKeys();
render(html`<${App} />`, /** @type {HTMLElement} */ (document.querySelector('.app')));
