// @ts-check
/** The notice of maintenance that admins show to everybody. */

import { request } from './client.js';

/** @typedef {{text: string, starts: string | null, until: string | null}} BannerJson */

/** @param {BannerJson} banner @returns {Promise<BannerJson>} */
export const putMaintenance = (banner) => request('/maintenance', { method: 'PUT', body: banner });

export const deleteMaintenance = () => request('/maintenance', { method: 'DELETE' });
