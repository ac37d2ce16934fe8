// @ts-check
/** Where files come from: this computer, or a folder that the operator allowed. */

import { html } from 'htm/preact';
import { useEffect, useRef, useState } from 'preact/hooks';

import { getFolders, postUpload } from '../api/imports.js';
import { sentenceOf } from '../api/problem.js';
import { useResource } from '../lib/resource.js';

/** @import {FolderEntry, ImportSource, UploadJson} from '../api/imports.js' */

/** @param {number} bytes */
export function sizeText(bytes) {
	const units = ['B', 'kB', 'MB', 'GB'];
	const power = Math.min(units.length - 1, Math.floor(Math.log10(Math.max(1, bytes)) / 3));
	return `${(bytes / 1000 ** power).toFixed(power === 0 ? 0 : 1)} ${units[power]}`;
}

/** Sends a file at once and says how far it is. @param {{id: string, label: string, accept?: string, hint?: string, onUploaded: (sent: UploadJson | null) => void}} props */
export function UploadField({ id, label, accept, hint = '', onUploaded }) {
	const [state, setState] = useState({ share: 0, name: '', error: '', done: false });
	const sending = useRef(/** @type {AbortController | null} */ (null));
	/** @param {Event} event */
	async function choose(event) {
		const file = /** @type {HTMLInputElement} */ (event.target).files?.[0];
		sending.current?.abort();
		onUploaded(null);
		setState({ share: 0, name: file?.name ?? '', error: '', done: false });
		if (!file) return;
		const controller = new AbortController();
		sending.current = controller;
		try {
			const sent = await postUpload(file, (share) => setState((before) => ({ ...before, share })), controller.signal);
			setState({ share: 1, name: `${sent.name}, ${sizeText(sent.bytes)}`, error: '', done: true });
			onUploaded(sent);
		} catch (error) {
			if (!controller.signal.aborted) setState({ share: 0, name: '', error: sentenceOf(error), done: false });
		}
	}
	const percent = Math.round(100 * state.share);
	return html`
		<div class="form__row">
			<label for=${id}>${label}</label>
			<input class="field" id=${id} type="file" accept=${accept} onChange=${choose} />
			${hint ? html`<small>${hint}</small>` : null}
			${state.name && !state.done ? html`<div class="meter" role="progressbar" aria-label=${`Upload of ${state.name}`} aria-valuenow=${percent}><span style=${{ width: `${percent}%` }}></span></div>` : null}
			${state.done ? html`<p class="note" role="status">✓ ${state.name} is uploaded</p>` : null}
			${state.error ? html`<p class="form__error" role="alert">${state.error}</p>` : null}
		</div>
	`;
}

/** @param {{chosen: string, choose: (path: string) => void, guess: (format: string) => void}} props */
function FolderList({ chosen, choose, guess }) {
	const [path, setPath] = useState('');
	const [trail, setTrail] = useState(/** @type {string[]} */ ([]));
	const folders = useResource((signal) => getFolders(path, signal), [path]);
	const items = folders.value?.items ?? [];
	const guessed = folders.value?.path === path ? folders.value.format : null;
	useEffect(() => { if (guessed) guess(guessed); }, [guessed]);
	/** @param {FolderEntry} entry */
	function enter(entry) {
		choose(entry.path);
		if (!entry.folder) return;
		setTrail([...trail, path]);
		setPath(entry.path);
	}
	function back() {
		setPath(trail[trail.length - 1]);
		setTrail(trail.slice(0, -1));
	}
	return html`
		<div class="form__row">
			<span class="form__label">Folder on the server${chosen ? html`: <strong>${chosen}</strong>` : null}</span>
			${folders.error ? html`<p class="form__error" role="alert">${sentenceOf(folders.error)}</p>` : null}
			<ul class="folders" aria-label="Folders">
				${trail.length ? html`<li><button class="folders__entry" type="button" onClick=${back}>↑ back</button></li>` : null}
				${items.map((entry) => html`
					<li key=${entry.path}>
						<button class="folders__entry" type="button" aria-pressed=${entry.path === chosen} onClick=${() => enter(entry)}>${entry.name}${entry.folder ? '/' : ''}</button>
					</li>`)}
			</ul>
			${folders.value?.more ? html`<small>There is more than is listed here.</small>` : null}
			${folders.value && items.length === 0 && trail.length === 0 ? html`<small>The operator has allowed no folder (TOUCHLINE_IMPORT_FOLDERS) and named no store (TOUCHLINE_STORES).</small>` : null}
		</div>
	`;
}

/** @param {{onSource: (source: ImportSource | null) => void, guess: (format: string) => void}} props `guess`: what the files most likely are */
export function SourceChoice({ onSource, guess }) {
	const [kind, setKind] = useState('upload');
	const [folder, setFolder] = useState('');
	/** @param {string} next */
	function change(next) {
		setKind(next);
		onSource(next === 'folder' && folder ? { folder } : null);
	}
	return html`
		<fieldset class="choice import__choice">
			<legend>Source</legend>
			<label><input type="radio" name="source" checked=${kind === 'upload'} onChange=${() => change('upload')} /><span>A file on this computer<small>zip, JSON or CSV</small></span></label>
			<label><input type="radio" name="source" checked=${kind === 'folder'} onChange=${() => change('folder')} /><span>A folder on the server<small>or in an object store; frames stay there</small></span></label>
		</fieldset>
		${kind === 'upload'
			? html`<${UploadField} id="import-file" label="File" onUploaded=${(/** @type {UploadJson | null} */ sent) => {
				onSource(sent && { upload: sent.id });
				if (sent?.format) guess(sent.format);
			}} />`
			: html`<${FolderList} chosen=${folder} guess=${guess} choose=${(/** @type {string} */ path) => { setFolder(path); onSource({ folder: path }); }} />`}
	`;
}
