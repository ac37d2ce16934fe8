// @ts-check
/** Requests about the addresses that are told what happens in a dataset. */

import { queryText, request } from './client.js';

/** @typedef {{id: number, url: string, kinds: string[], off: string | null, created: string, created_by: string, waiting: number, delivered: number, failed: number}} WebhookJson */
/** @typedef {{items: WebhookJson[], allowed: string[], kinds: string[]}} WebhookList */
/** @typedef {{webhook: WebhookJson, secret: string}} WebhookWithSecret */
/** @typedef {{id: number, message: string, kind: string, body: string, created: string, state: 'waiting' | 'delivered' | 'failed', attempts: number, next_at: string | null, tried: string | null, status: number | null, problem: string | null}} DeliveryJson */

/** @param {number} dataset @param {string} [rest] */
const at = (dataset, rest = '') => `/datasets/${dataset}/webhooks${rest}`;

/** @param {number} dataset @param {AbortSignal} [signal] @returns {Promise<WebhookList>} */
export const getWebhooks = (dataset, signal) => request(at(dataset), { signal });

/** @param {number} dataset @param {string} url @param {string[]} kinds @returns {Promise<WebhookWithSecret>} */
export const postWebhook = (dataset, url, kinds) => request(at(dataset), { method: 'POST', body: { url, kinds } });

/** @param {number} dataset @param {number} id @param {{on: boolean}} body @returns {Promise<WebhookJson>} */
export const patchWebhook = (dataset, id, body) => request(at(dataset, `/${id}`), { method: 'PATCH', body });

/** @param {number} dataset @param {number} id */
export const deleteWebhook = (dataset, id) => request(at(dataset, `/${id}`), { method: 'DELETE' });

/** @param {number} dataset @param {number} id @returns {Promise<WebhookWithSecret>} */
export const renewWebhookSecret = (dataset, id) => request(at(dataset, `/${id}/secret`), { method: 'POST' });

/** @param {number} dataset @param {number} id @returns {Promise<DeliveryJson>} */
export const pingWebhook = (dataset, id) => request(at(dataset, `/${id}/ping`), { method: 'POST' });

/** @param {number} dataset @param {number} id @param {number} limit @returns {Promise<{items: DeliveryJson[]}>} */
export const getDeliveries = (dataset, id, limit) => request(at(dataset, `/${id}/deliveries${queryText({ limit })}`));

/** @param {number} dataset @param {number} id @param {number} delivery @returns {Promise<DeliveryJson>} */
export const sendAgain = (dataset, id, delivery) => request(at(dataset, `/${id}/deliveries/${delivery}`), { method: 'POST' });
