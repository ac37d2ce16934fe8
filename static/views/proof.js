// @ts-check
/** What shows that it is still the same person: the password, or having come by single sign-on just now. */

import { me } from '../state/me.js';

/** How a field for the password is described, and whether it may stay empty. */
export function proof() {
	const optional = me.value?.way === 'sign_on';
	return { label: optional ? 'Your password (not needed within ten minutes of logging in)' : 'Your password', optional };
}
