import assert from 'node:assert/strict';
import { existsSync, readdirSync, readFileSync } from 'node:fs';
import { dirname, join, resolve } from 'node:path';
import { describe, it } from 'node:test';
import { fileURLToPath } from 'node:url';

const STATIC = resolve(dirname(fileURLToPath(import.meta.url)), '../../static');
const page = readFileSync(join(STATIC, 'index.html'), 'utf8');
const { imports } = JSON.parse(/<script type="importmap">([\s\S]*?)<\/script>/.exec(page)[1]);

/** The address of a module that a file names. */
function addressOf(specifier, from) {
	if (specifier.startsWith('.')) return join(dirname(from), specifier);
	const prefix = Object.keys(imports).find((name) => name.endsWith('/') && specifier.startsWith(name));
	return imports[specifier] ?? (prefix && imports[prefix] + specifier.slice(prefix.length));
}

/** Every module that main.js needs, itself included. */
function graph(address = '/static/main.js', found = new Set()) {
	if (found.has(address)) return found;
	found.add(address);
	const source = readFileSync(join(STATIC, address.replace('/static/', '')), 'utf8');
	const code = source.replaceAll(/\/\*[\s\S]*?\*\//g, '');
	for (const [, specifier] of code.matchAll(/(?:^|[;}\n])\s*(?:import|export)(?:[^'"`;()]*?from)?\s*["']([^"']+)["']/g)) {
		const next = addressOf(specifier, address);
		assert.ok(next, `${address} imports ${specifier}, which the import map does not know`);
		graph(next, found);
	}
	return found;
}

describe('index.html', () => {
	const preloaded = [...page.matchAll(/rel="modulepreload" href="([^"]+)"/g)].map(([, href]) => href);

	it('announces every module, so that none waits for another to be read', () => {
		const needed = [...graph()].filter((address) => address !== '/static/main.js').sort();
		assert.deepEqual([...preloaded].sort(), needed);
	});

	it('has one inline script, the import map', () => {
		const inline = [...page.matchAll(/<script\b([^>]*)>/g)].filter(([, attributes]) => !attributes.includes('src='));
		assert.deepEqual(inline.map(([, attributes]) => attributes.trim()), ['type="importmap"']);
	});

	it('loads nothing from elsewhere', () => {
		assert.doesNotMatch(page, /(?:src|href)="(?:https?:)?\/\//);
	});

	it('names style sheets that exist', () => {
		const sheets = [...page.matchAll(/rel="stylesheet" href="\/static\/([^"]+)"/g)].map(([, href]) => href);
		assert.ok(sheets.every((sheet) => existsSync(join(STATIC, sheet))));
		assert.equal(sheets.length, readdirSync(join(STATIC, 'css')).length);
	});
});

describe('package-lock.json', () => {
	it('holds no address of a registry', () => {
		const lock = JSON.parse(readFileSync(join(STATIC, 'package-lock.json'), 'utf8'));
		assert.ok(Object.values(lock.packages).every((entry) => !('resolved' in entry)));
	});

	it('pins what package.json names', () => {
		const { dependencies, devDependencies } = JSON.parse(readFileSync(join(STATIC, 'package.json'), 'utf8'));
		for (const version of Object.values({ ...dependencies, ...devDependencies })) {
			assert.match(version, /^\d+\.\d+\.\d+$/);
		}
	});
});

/** Every file of ours with that ending. */
function ours(ending, folder = STATIC) {
	return readdirSync(folder, { withFileTypes: true }).flatMap((entry) => {
		// Libraries, and the same files joined.
		if (['node_modules', 'built', 'built.new'].includes(entry.name)) return [];
		const path = join(folder, entry.name);
		if (entry.isDirectory()) return ours(ending, path);
		return entry.name.endsWith(ending) ? [path] : [];
	});
}

describe('the code', () => {
	it('talks to the server in one file only', () => {
		const speaking = ours('.js').filter((path) => /\bfetch\(|XMLHttpRequest|WebSocket/.test(readFileSync(path, 'utf8')));
		assert.deepEqual(speaking.map((path) => path.slice(STATIC.length + 1)), ['api/client.js']);
	});

	it('never turns text into markup or code', () => {
		const banned = /innerHTML|outerHTML|insertAdjacentHTML|document\.write|dangerouslySetInnerHTML|\beval\(|new Function/;
		assert.deepEqual(ours('.js').filter((path) => banned.test(readFileSync(path, 'utf8'))), []);
	});

	it('is checked for types in every file', () => {
		assert.deepEqual(ours('.js').filter((path) => !readFileSync(path, 'utf8').startsWith('// @ts-check')), []);
	});

	it('keeps every colour in tokens.css', () => {
		const loose = ours('.css').filter((path) => !path.endsWith('tokens.css'))
			.filter((path) => /#[0-9a-f]{3,8}\b|rgba?\(|hsla?\(|!important/i.test(readFileSync(path, 'utf8')));
		assert.deepEqual(loose, []);
	});
});
