// @ts-check
/** Passkeys: what the server asks the browser's devices for, and what these answer. */

import { request } from './client.js';
import { ApiError } from './problem.js';

/** @import {SessionJson} from './people.js' */

/** @typedef {{id: number, name: string, created: string, used: string | null}} PasskeyJson */

/** Whether this browser can speak of passkeys at this address, which may be no mere number. */
export const passkeysWork = () => typeof PublicKeyCredential === 'function' && 'parseRequestOptionsFromJSON' in PublicKeyCredential
	&& isSecureContext && !/^[\d.]+$|^\[/.test(location.hostname);

/** @returns {Promise<{items: PasskeyJson[], unavailable: string | null}>} */
export const getPasskeys = () => request('/session/passkeys');

/** @param {number} id @param {string | null} password */
export const deletePasskey = (id, password) => request(`/session/passkeys/${id}`, { method: 'DELETE', body: { password } });

/** Make a passkey in a device. @param {string} name @param {string | null} password @returns {Promise<{passkey: PasskeyJson, codes: string[]}>} */
export async function makePasskey(name, password) {
	const { options } = await request('/session/passkeys/begin', { method: 'POST', body: { password } });
	const made = await askDevice(() => navigator.credentials.create({ publicKey: PublicKeyCredential.parseCreationOptionsFromJSON(options) }));
	const { clientDataJSON, attestationObject } = made.response;
	return request('/session/passkeys', { method: 'POST', body: { name, credential: plain(made, { clientDataJSON, attestationObject }) } });
}

/** Log in with a passkey that a device of this person has. @returns {Promise<SessionJson>} */
export async function enterWithPasskey() {
	const { options } = await request('/session/passkey/begin', { method: 'POST' });
	const signed = await askDevice(() => navigator.credentials.get({ publicKey: PublicKeyCredential.parseRequestOptionsFromJSON(options) }));
	const { clientDataJSON, authenticatorData, signature, userHandle } = signed.response;
	return request('/session/passkey', { method: 'POST', body: { credential: plain(signed, { clientDataJSON, authenticatorData, signature, userHandle }) } });
}

/** What a device answers, as JSON. @param {() => Promise<Credential | null>} ask @returns {Promise<any>} */
async function askDevice(ask) {
	try {
		const found = /** @type {PublicKeyCredential | null} */ (await ask());
		if (found) return found.toJSON();
	} catch (error) {
		if (!(error instanceof DOMException)) throw error;
		if (error.name === 'InvalidStateError') throw new ApiError(400, { detail: 'this device already has one of your passkeys' });
	}
	throw new ApiError(400, { detail: 'no passkey was used', hint: 'The device did not respond, or the request was cancelled.' });
}

/** The parts of an answer that are sent. @param {any} credential @param {object} response */
function plain({ id, rawId, type }, response) {
	return { id, rawId, type, response };
}
