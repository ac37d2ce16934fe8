// @ts-check
/** Components whose code is fetched when they are first shown. */

import { html } from 'htm/preact';
import { useEffect, useState } from 'preact/hooks';

/** @import {ComponentType} from 'preact' */

/**
 * A component that shows nothing until its code is there.
 *
 * @param {() => Promise<ComponentType>} load
 * @returns {ComponentType}
 */
export function lazy(load) {
	/** @type {ComponentType | null} */
	let View = null;
	return function Lazy() {
		const [, arrive] = useState(false);
		useEffect(() => {
			if (!View) load().then((loaded) => { View = loaded; arrive(true); }, () => {});
		}, []);
		return View ? html`<${View} />` : null;
	};
}
