// @ts-check
/** The buttons in the corner of a panel: draw, brightness, size. */

import { html } from 'htm/preact';
import { useEffect, useState } from 'preact/hooks';

import { lazy } from '../lib/lazy.js';
import { filterOf } from '../state/adjustments.js';
import { endDrawing, startDrawing } from '../state/drawing.js';
import { editorAddress } from '../state/editor_address.js';
import { group } from '../state/group.js';
import { findFramesAround, framesAround, stepInstant } from '../state/instants.js';
import { filled, toggleFilled } from '../state/viewports.js';
import { drawing, equalViews, focusView, maximised, toggleMaximised } from '../state/workspace.js';
import { followAnew } from './follow_parts.js';


/** @import {ViewJson} from '../api/types.js' */
/** @import {ViewPicture} from '../overlays/scene.js' */

const AdjustPopover = lazy(async () => (await import('./adjust_popover.js')).AdjustPopover);

const PATHS = {
	follow: 'M2 12.5c2-6 4.5-7.5 7-4.5M12 5.2a2.3 2.3 0 1 0 0 4.6 2.3 2.3 0 0 0 0-4.6M2 12.5v-2.6M2 12.5h2.6',
	draw: 'M3 13l.8-3L11 2.8 13.2 5 6 12.2zM9.6 4.2l2.2 2.2',
	camera: 'M2 4.5h3l1-1.5h4l1 1.5h3v8H2zM8 6.2a2.3 2.3 0 1 0 0 4.6 2.3 2.3 0 0 0 0-4.6',
	light: 'M8 5.2a2.8 2.8 0 1 0 0 5.6 2.8 2.8 0 0 0 0-5.6M8 1.5v1.6M8 12.9v1.6M1.5 8h1.6M12.9 8h1.6M3.4 3.4l1.1 1.1M11.5 11.5l1.1 1.1M3.4 12.6l1.1-1.1M11.5 4.5l1.1-1.1',
	equal: 'M2.5 3.5h5v9h-5zM8.5 3.5h5v9h-5z',
	main: 'M2.5 3.5h7v9h-7zM10.5 3.5h3v4h-3zM10.5 8.5h3v4h-3z',
	before: 'M12.5 3.5h-4v9h4M6 5 3 8l3 3',
	after: 'M3.5 3.5h4v9h-4M10 5l3 3-3 3',
	crop: 'M4.5 1.5v10h10M1.5 4.5h10v10',
	larger: 'M9 3h4v4M7 13H3V9',
	smaller: 'M7 3v4H3M9 13V9h4',
};

/** @param {{label: string, title: string, path: string, pressed?: boolean, onClick: () => void}} props */
function Tool({ label, title, path, pressed, onClick }) {
	return html`
		<button class="icon-button" type="button" aria-label=${label} title=${title} aria-pressed=${pressed} onClick=${onClick}>
			<svg viewBox="0 0 16 16" aria-hidden="true"><path d=${path} /></svg>
		</button>
	`;
}

/** Only who stays with a group looks at other frames. */
const ASK_AFTER = 700;

/** Whether there are frames around that of a view; asked for a moment later. @param {ViewJson} view */
function useFramesAround(view) {
	useEffect(() => {
		if (!view.neighbours || framesAround.value.has(view.id)) return undefined;
		// Without an answer there are no buttons; the keys say what is wrong.
		const timer = setTimeout(() => { findFramesAround(view).catch(() => {}); }, ASK_AFTER);
		return () => clearTimeout(timer);
	}, [view.id, view.neighbours]);
	return Boolean(framesAround.value.get(view.id)?.length);
}

/** @param {string} letter @param {-1 | 1} by */
function step(letter, by) {
	focusView(letter);
	stepInstant(by);
}

/** @param {{picture: ViewPicture, sizes: boolean}} props sizes: whether the views may have other sizes */
export function PanelTools({ picture, sizes }) {
	const [open, setOpen] = useState(false);
	const { key, letter } = picture.view;
	const draws = drawing.value?.view === key;
	const alone = maximised.value !== null;
	const around = useFramesAround(picture.view);
	return html`
		<div class="panel-tools">
			${around ? html`
				<${Tool} label=${`View ${letter} one frame before`} title="One frame before (,)" path=${PATHS.before} onClick=${() => step(letter, -1)} />
				<${Tool} label=${`View ${letter} one frame after`} title="One frame after (.)" path=${PATHS.after} onClick=${() => step(letter, 1)} />` : null}
			<${Tool} label=${`Draw in view ${letter}`} title="Draw a ball, a marking, a point (N)" path=${PATHS.draw} pressed=${draws}
				onClick=${() => (draws ? endDrawing() : startDrawing(letter))} />
			${picture.view.station.shared && picture.view.balls.length ? html`
				<${Tool} label=${`Follow the ball of view ${letter}`} title="Follow the ball through the groups before and after (Shift+Q)" path=${PATHS.follow}
					onClick=${() => { focusView(letter); followAnew(picture.view); }} />` : null}
			<a class="icon-button" href=${group.value ? editorAddress(group.value.id, key) : undefined} aria-label=${`Calibration of view ${letter}`} title="Calibration editor (K)">
				<svg viewBox="0 0 16 16" aria-hidden="true"><path d=${PATHS.camera} /></svg>
			</a>
			<${Tool} label=${`Brightness and contrast of view ${letter}`} title="Brightness and contrast" path=${PATHS.light}
				pressed=${open || filterOf(letter) !== 'none'} onClick=${() => setOpen(!open)} />
			${sizes && !alone ? html`
				<${Tool} label=${equalViews.value ? 'Main camera large' : 'All views equally large'}
					title=${equalViews.value ? 'Main camera large (Shift+L)' : 'All views equally large (Shift+L)'}
					path=${equalViews.value ? PATHS.main : PATHS.equal} onClick=${() => { equalViews.value = !equalViews.value; }} />` : null}
			<${Tool} label=${filled.value ? 'Show whole images' : 'Fill the panels with the images'}
				title=${filled.value ? 'Images are cropped to fill their panels; show them whole (Shift+Z)' : 'Crop the images so that they fill their panels (Shift+Z)'}
				path=${PATHS.crop} pressed=${filled.value} onClick=${toggleFilled} />
			<${Tool} label=${alone ? 'Show all views' : `Show only view ${letter}`} title=${alone ? 'Show all views' : 'Show only this view'}
				path=${alone ? PATHS.smaller : PATHS.larger} onClick=${() => toggleMaximised(letter)} />
		</div>
		${open ? html`<${AdjustPopover} letter=${letter} onClose=${() => setOpen(false)} />` : null}
	`;
}
