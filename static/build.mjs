/**
 * Joins the modules of the application into few files below `built/`, so that a page asks for a handful instead of two
 * hundred. The modules stay what is written, read and debugged: the server sends the joined files only while they say
 * of themselves the same digest that the modules have, and the source maps lead back.
 *
 * A module that is imported when it is first needed still runs no earlier; what it holds comes along, but for `APART`.
 */

import { createHash } from 'node:crypto';
import { readdirSync, readFileSync, renameSync, rmSync, writeFileSync } from 'node:fs';
import { dirname, join, relative } from 'node:path';
import { fileURLToPath } from 'node:url';

import { build } from 'esbuild';

const HERE = dirname(fileURLToPath(import.meta.url));
const FINAL = join(HERE, 'built');
const UNFINISHED = join(HERE, 'built.new');
const ENTRIES = ['ahead.js', 'main.js'];
/** What tests, and whoever looks into a running page from the console, import by name: the very modules that run there. */
const DOORS = ['api/events.js', 'state/documents.js', 'state/facets.js', 'state/me.js'];
/** What brings a library as large as all of the application. */
const APART = ['./panel.js', '../scene3d/track_panel.js'];
const IMPORT = /\bimport\((['"])(\.{1,2}\/[^'"]+)\1\)/g;

/** Paths of all modules of the application, in the order of their characters. */
function modules() {
	const names = readdirSync(HERE, { recursive: true }).map((name) => name.split('\\').join('/'));
	const ours = names.filter((name) => name.endsWith('.js') && !/^(node_modules|built|built\.new)\//.test(name));
	return ours.sort();
}

/** As `app/http/pages.py` reckons it. */
function digest() {
	const hash = createHash('sha256');
	for (const name of [...modules(), 'package-lock.json']) {
		hash.update(`${name}\n`);
		hash.update(readFileSync(join(HERE, name)));
	}
	return hash.digest('hex');
}

const joined = {
	name: 'joined',
	setup({ onLoad }) {
		onLoad({ filter: /\.js$/, namespace: 'file' }, ({ path }) => {
			if (path.includes('node_modules')) return undefined;
			const lazy = (asked, _, name) => (APART.includes(name) ? asked : `Promise.resolve().then(() => require('${name}'))`);
			const own = `new URL('../${relative(HERE, path)}', import.meta.url).href`;
			const contents = readFileSync(path, 'utf8').replace(IMPORT, lazy).replaceAll('import.meta.url', own);
			return { contents, loader: 'js' };
		});
	},
};

/** What the entries need before they run. */
function neededFirst({ outputs }, entries) {
	const found = new Set();
	const walk = (path) => {
		if (found.has(path)) return;
		found.add(path);
		for (const { path: next, kind } of outputs[path].imports) if (kind === 'import-statement') walk(next);
	};
	entries.forEach(walk);
	return [...found].map((path) => relative(UNFINISHED, join(HERE, path))).filter((name) => !ENTRIES.includes(name));
}

const of = digest();
rmSync(UNFINISHED, { recursive: true, force: true });
const { metafile } = await build({
	absWorkingDir: HERE,
	entryPoints: [...ENTRIES, ...DOORS],
	outdir: UNFINISHED,
	bundle: true,
	splitting: true,
	format: 'esm',
	target: 'es2023',
	minify: true,
	sourcemap: true,
	sourcesContent: false,
	legalComments: 'eof',
	metafile: true,
	alias: { 'konva/konva.min.js': join(HERE, 'node_modules/konva/konva.min.js') },
	plugins: [joined],
	logLevel: 'warning',
});
const entries = ENTRIES.map((name) => relative(HERE, join(UNFINISHED, name)));
const about = { of, needed_first: neededFirst(metafile, entries) };
writeFileSync(join(UNFINISHED, 'about.json'), `${JSON.stringify(about, null, '\t')}\n`);
rmSync(FINAL, { recursive: true, force: true });
renameSync(UNFINISHED, FINAL);
