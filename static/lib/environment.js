// @ts-check
/**
 * @tanstack/virtual-core asks `process.env.NODE_ENV`, which bundlers replace and browsers do not
 * have. Import this file before it; it can go once the library's module runs as it is.
 */

/** @type {any} */ (globalThis).process ??= { env: { NODE_ENV: 'production' } };
