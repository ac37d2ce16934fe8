// @ts-check
/** The place of the 3D view; what draws it is loaded when it is first shown. */

import { html } from 'htm/preact';
import { useEffect, useState } from 'preact/hooks';

import { sceneShown, toggleScene } from '../../state/scene3d.js';

/** @import {GroupDocument, SolutionJson} from '../../api/types.js' */
/** @import {Binding} from '../../lib/keys.js' */

/** @typedef {typeof import('./panel.js').ScenePanel} Panel */

/** @type {Binding[]} */
export const SCENE_KEYS = [
	{ keys: ['\\'], label: '3D view', group: 'View', run: toggleScene },
];

/** @param {{group: GroupDocument, solution: SolutionJson | null}} props */
export function Scene3D({ group, solution }) {
	const [panel, setPanel] = useState(/** @type {{show: Panel} | null} */ (null));
	const [failed, setFailed] = useState('');
	useEffect(() => {
		let wanted = true;
		import('./panel.js').then(
			({ ScenePanel }) => { if (wanted) setPanel({ show: ScenePanel }); },
			() => { if (wanted) setFailed('The 3D view could not be loaded.'); },
		);
		return () => { wanted = false; };
	}, []);
	return html`
		<section class="scene3d" aria-label="3D view" aria-busy=${!panel && !failed}>
			<p class="small-note">The 3D view needs a wider screen or window. <button class="button" type="button" onClick=${() => { sceneShown.value = false; }}>Images</button></p>
			${panel ? html`<${panel.show} group=${group} solution=${solution} />` : html`
				<p class="scene3d__missing" role="status">${failed || 'Loading the 3D view…'}
					<button class="button" type="button" onClick=${() => { sceneShown.value = false; }}>Images <kbd>\\</kbd></button>
				</p>`}
		</section>
	`;
}
