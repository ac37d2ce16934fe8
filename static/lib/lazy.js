// @ts-check
/** Components whose code is fetched when they are first shown. */

import { html } from 'htm/preact';
import { useEffect, useState } from 'preact/hooks';

/** @import {ComponentType} from 'preact' */

/**
 * A component that shows nothing until its code is there.
 *
 * @template P
 * @param {() => Promise<ComponentType<P>>} load
 * @returns {ComponentType<P>}
 */
export function lazy(load) {
	/** @type {ComponentType<P> | null} */
	let View = null;
	return function Lazy(/** @type {P} */ props) {
		const [, arrive] = useState(false);
		useEffect(() => {
			if (!View) load().then((loaded) => { View = loaded; arrive(true); }, () => {});
		}, []);
		return View ? html`<${View} ...${props} />` : null;
	};
}
