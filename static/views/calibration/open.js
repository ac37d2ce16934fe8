// @ts-check
/** The way from the review screen to the calibration editor. */

import { navigate } from '../../lib/router.js';
import { editorAddress } from '../../state/editor_address.js';
import { group } from '../../state/group.js';
import { focused } from '../../state/workspace.js';

/** @import {Binding} from '../../lib/keys.js' */

function openEditor() {
	const at = group.value;
	const view = at?.views.find(({ letter }) => letter === focused.value);
	if (at && view) navigate(editorAddress(at.id, view.key));
}

/** @type {Binding[]} */
export const EDITOR_DOOR = [
	{ keys: ['k'], label: 'Open the calibration editor of the focused view', group: 'View', run: openEditor },
];
