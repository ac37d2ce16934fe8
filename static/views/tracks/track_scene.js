// @ts-check
/** The place of a track's 3D view; what draws it is loaded when it is first shown. */

import { html } from 'htm/preact';
import { useEffect, useState } from 'preact/hooks';

/** @import {TrackFrames, TrackJson} from '../../api/tracks.js' */

/** @typedef {typeof import('../scene3d/track_panel.js').TrackScene} Panel */

/** @param {{track: TrackJson, frames: TrackFrames, at: number, plays: boolean, leave: () => void}} props */
export function TrackSpace(props) {
	const [panel, setPanel] = useState(/** @type {{show: Panel} | null} */ (null));
	const [failed, setFailed] = useState('');
	useEffect(() => {
		let wanted = true;
		import('../scene3d/track_panel.js').then(
			({ TrackScene }) => { if (wanted) setPanel({ show: TrackScene }); },
			() => { if (wanted) setFailed('The 3D view could not be loaded.'); },
		);
		return () => { wanted = false; };
	}, []);
	return html`
		<section class="scene3d track__space" aria-label="3D view" aria-busy=${!panel && !failed}>
			<p class="small-note">The 3D view needs a wider screen or window. <button class="button" type="button" onClick=${props.leave}>Curves</button></p>
			${panel ? html`<${panel.show} ...${props} />` : html`<p class="scene3d__missing" role="status">${failed || 'Loading the 3D view…'}</p>`}
		</section>
	`;
}
