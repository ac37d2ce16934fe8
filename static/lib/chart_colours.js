// @ts-check
/** The colours of tokens.css for charts; they follow the scheme. */

import { followed, tokens } from './css_values.js';

const NAMES = /** @type {const} */ (['ink', 'muted', 'line', 'bad', 'panel', 'chart-a', 'chart-b', 'chart-c', 'chart-d', 'chart-e', 'chart-f', 'chart-grid']);

/** @typedef {typeof NAMES[number]} ChartColour */

/** As they are now. */
export const chartColours = followed(() => tokens(NAMES));
