// @ts-check
/** Requests about what somebody is told. */

import { request } from './client.js';

/** @typedef {{id: number, at: string, kind: 'mention' | 'reply' | 'job' | 'assigned' | 'returned', actor: string, sentence: string, address: string, dataset: string | null, group_id: number | null, read: string | null}} NotificationJson */
/** @typedef {{items: NotificationJson[], unread: number}} NotificationsJson */

/** @returns {Promise<NotificationsJson>} */
export const getNotifications = () => request('/notifications?limit=50');

/** @param {number[] | null} ids null: all of it @returns {Promise<NotificationsJson>} */
export const postNotificationsRead = (ids) => request('/notifications/read', { method: 'POST', body: { ids } });
