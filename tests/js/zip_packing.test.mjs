import assert from 'node:assert/strict';
import { execFileSync } from 'node:child_process';
import { mkdtempSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { describe, it } from 'node:test';

import { areVideos, chosenFiles } from '../../static/lib/local_files.js';
import { crc32, packFiles } from '../../static/lib/zip_packing.js';

const bytes = (text) => new TextEncoder().encode(text);
const given = (path, content = 'x') => ({ path, file: new File([content], path.split('/').at(-1)) });

describe('crc32', () => {
	it('is that of zips', () => {
		assert.equal(crc32(bytes('')), 0);
		assert.equal(crc32(bytes('123456789')), 0xcbf43926);
	});
});

describe('packFiles', () => {
	it('makes a zip that others read, sorted, with folders and names of any script', async () => {
		const packed = await packFiles([given('b/grün.png', 'hello'), given('a.jpg', '')], 'b.zip');
		assert.equal(packed.name, 'b.zip');
		const file = join(mkdtempSync(join(tmpdir(), 'zip-')), 'b.zip');
		writeFileSync(file, new Uint8Array(await packed.arrayBuffer()));
		const script = 'import sys, zipfile; z = zipfile.ZipFile(sys.argv[1]); print(z.testzip(), [(n, z.read(n).decode()) for n in z.namelist()])';
		const said = execFileSync('python3', ['-c', script, file], { encoding: 'utf8', env: { ...process.env, PYTHONIOENCODING: 'utf-8' } });
		assert.equal(said.trim(), "None [('a.jpg', ''), ('b/grün.png', 'hello')]");
	});

	it('is the same zip of the same files in another order', async () => {
		const files = [given('a.jpg', '1'), given('b.jpg', '2')];
		const first = await (await packFiles(files, 'x.zip')).arrayBuffer();
		const second = await (await packFiles([...files].reverse(), 'x.zip')).arrayBuffer();
		assert.deepEqual(new Uint8Array(first), new Uint8Array(second));
	});

	it('refuses what a zip of this kind has no room for', async () => {
		const one = given('a.jpg');
		await assert.rejects(packFiles(Array.from({ length: 65_536 }, () => one), 'x.zip'), /Too many files/);
	});
});

describe('chosenFiles', () => {
	it('leaves out files of operating systems', () => {
		const names = ['a.jpg', '.DS_Store', 'Thumbs.db', 'desktop.ini', 'thumbs.jpg'];
		const kept = chosenFiles(names.map((name) => new File(['x'], name))).map(({ path }) => path);
		assert.deepEqual(kept, ['a.jpg', 'thumbs.jpg']);
	});
});

describe('areVideos', () => {
	it('is asked of all files: a video may belong to ground truth', () => {
		assert.equal(areVideos([given('match.MP4')]), true);
		assert.equal(areVideos([given('cam1.mpg'), given('ground_truth_1.xgtf')]), false);
		assert.equal(areVideos([given('a.jpg')]), false);
		assert.equal(areVideos([]), false);
	});
});
