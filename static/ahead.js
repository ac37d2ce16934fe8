// @ts-check
/** Asks for the group that the address names while the rest of the application is on its way. */

import { prefetch } from './state/documents.js';

const group = /^\/review\/(\d+)/.exec(location.pathname);
if (group) prefetch([Number(group[1])]);
