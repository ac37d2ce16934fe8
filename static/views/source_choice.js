// @ts-check
/** Where files come from: this computer, or a folder that the operator allowed. */

import { html } from 'htm/preact';
import { useEffect, useRef, useState } from 'preact/hooks';

import { getFolders, getUploadRoom, postUpload } from '../api/imports.js';
import { sentenceOf } from '../api/problem.js';
import { areVideos, chosenFiles, droppedFiles } from '../lib/local_files.js';
import { plural } from '../lib/format.js';
import { useResource } from '../lib/resource.js';
import { packFiles } from '../lib/zip_packing.js';

/** @import {FolderEntry, ImportSource, UploadJson} from '../api/imports.js' */
/** @import {PathFile} from '../lib/zip_packing.js' */

/** @param {number} bytes */
export function sizeText(bytes) {
	const units = ['B', 'kB', 'MB', 'GB'];
	const power = Math.min(units.length - 1, Math.floor(Math.log10(Math.max(1, bytes)) / 3));
	return `${(bytes / 1000 ** power).toFixed(power === 0 ? 0 : 1)} ${units[power]}`;
}

const ELSEWHERE = 'Add it on the page Recordings: Touchline finds its shots there, and frames that you choose become groups.';

/** One file to send: the only one as it is, several in a zip, as one in folders. @param {PathFile[]} files @param {AbortSignal} signal */
async function toSend(files, signal) {
	// A folder inside the chosen one may name a group; a zip names its own.
	const [{ path, file }] = files;
	if (files.length === 1 && (path.split('/').length < 3 || /\.zip$/i.test(path))) return file;
	const top = files[0].path.split('/')[0];
	const folder = files.every(({ path }) => path.startsWith(`${top}/`)) ? top : 'files';
	return packFiles(files, `${folder}.zip`, signal);
}

/** Sends files at once, and says how far they are. @param {(sent: UploadJson | null) => void} onUploaded */
function useUpload(onUploaded) {
	const [state, setState] = useState({ share: 0, name: '', error: '', done: false });
	const sending = useRef(/** @type {AbortController | null} */ (null));
	/** @param {PathFile[] | Promise<PathFile[]>} given */
	async function send(given) {
		sending.current?.abort();
		const controller = new AbortController();
		sending.current = controller;
		onUploaded(null);
		setState({ share: 0, name: '', error: '', done: false });
		try {
			const files = await given;
			if (files.length === 0) return;
			if (areVideos(files)) {
				const [{ path }] = files;
				setState({ share: 0, name: '', error: `${files.length === 1 ? `${path} is a video.` : `${path} and ${plural(files.length - 1, 'other file')} are videos.`} ${ELSEWHERE}`, done: false });
				return;
			}
			const name = files.length === 1 ? files[0].path : plural(files.length, 'file');
			setState({ share: 0, name, error: '', done: false });
			const file = await toSend(files, controller.signal);
			const sent = await postUpload(file, (share) => setState((before) => ({ ...before, share })), controller.signal);
			setState({ share: 1, name: `${files.length === 1 ? sent.name : name}, ${sizeText(sent.bytes)}`, error: '', done: true });
			onUploaded(sent);
		} catch (error) {
			if (!controller.signal.aborted) setState({ share: 0, name: '', error: sentenceOf(error), done: false });
		}
	}
	return { state, send };
}

/** Takes what is dropped anywhere on the page. @param {(files: Promise<PathFile[]>) => void} take @returns {boolean} whether something is held over it */
function useDrop(take) {
	const [over, setOver] = useState(false);
	const latest = useRef(take);
	latest.current = take;
	useEffect(() => {
		/** @param {DragEvent} event */
		const holds = (event) => event.dataTransfer?.types.includes('Files');
		/** @param {DragEvent} event */
		function drag(event) {
			if (!holds(event)) return;
			event.preventDefault();
			setOver(true);
		}
		/** @param {DragEvent} event */
		function leave(event) {
			if (!event.relatedTarget) setOver(false);
		}
		/** @param {DragEvent} event */
		function drop(event) {
			setOver(false);
			if (!holds(event) || !event.dataTransfer) return;
			event.preventDefault();
			latest.current(droppedFiles(event.dataTransfer));
		}
		addEventListener('dragover', drag);
		addEventListener('dragleave', leave);
		addEventListener('drop', drop);
		return () => {
			removeEventListener('dragover', drag);
			removeEventListener('dragleave', leave);
			removeEventListener('drop', drop);
		};
	}, []);
	return over;
}

/** @param {{state: {share: number, name: string, error: string, done: boolean}}} props */
function UploadState({ state }) {
	const percent = Math.round(100 * state.share);
	return html`
		${state.name && !state.done ? html`<div class="meter" role="progressbar" aria-label=${`Upload of ${state.name}`} aria-valuenow=${percent}><span style=${{ width: `${percent}%` }}></span></div>` : null}
		${state.done ? html`<p class="note" role="status">✓ ${state.name} ${/^\d+ files/.test(state.name) ? 'are' : 'is'} uploaded</p>` : null}
		${state.error ? html`<p class="form__error" role="alert">${state.error}</p>` : null}
	`;
}

/** @param {{id: string, label: string, accept?: string, hint?: string, onUploaded: (sent: UploadJson | null) => void}} props */
export function UploadField({ id, label, accept, hint = '', onUploaded }) {
	const { state, send } = useUpload(onUploaded);
	return html`
		<div class="form__row">
			<label for=${id}>${label}</label>
			<input class="field" id=${id} type="file" accept=${accept} onChange=${(/** @type {Event} */ event) => send(filesOf(event))} />
			${hint ? html`<small>${hint}</small>` : null}
			<${UploadState} state=${state} />
		</div>
	`;
}

/** How much of their room one's uploads take. @param {{sent: unknown}} props `sent`: another one asks again */
export function UploadRoom({ sent }) {
	const room = useResource((signal) => getUploadRoom(signal), [sent]).value;
	if (!room) return null;
	const { used_bytes: used, quota_bytes: quota, days, max_bytes: most } = room;
	return html`
		${quota === null ? null : html`<div class="meter" role="meter" aria-label="Space used by your uploads" aria-valuemin="0" aria-valuemax=${quota} aria-valuenow=${used} aria-valuetext=${`${sizeText(used)} of ${sizeText(quota)}`}><span style=${{ width: `${Math.min(100, (100 * used) / quota)}%` }}></span></div>`}
		<small>${quota === null ? `Your uploads take ${sizeText(used)}` : `Your uploads take ${sizeText(used)} of ${sizeText(quota)}`}; largest file ${sizeText(most)}. Files that no dataset uses are deleted after ${plural(days, 'day')}.</small>
	`;
}

/** Any number of files or a folder, chosen here or dropped. @param {{dropped: Promise<PathFile[]> | null, over: boolean, onUploaded: (sent: UploadJson | null) => void}} props */
function DropField({ dropped, over, onUploaded }) {
	const { state, send } = useUpload(onUploaded);
	useEffect(() => { if (dropped) send(dropped); }, [dropped]);
	return html`
		<div class="form__row import__drop" data-over=${over}>
			<label for="import-file">File</label>
			<input class="field" id="import-file" type="file" multiple onChange=${(/** @type {Event} */ event) => send(filesOf(event))} />
			<label for="import-folder">or a whole folder</label>
			<input class="field" id="import-folder" type="file" webkitdirectory onChange=${(/** @type {Event} */ event) => send(filesOf(event))} />
			<small>Or drop files, pictures or a folder anywhere on this page.</small>
			<${UploadState} state=${state} />
			<${UploadRoom} sent=${state.done} />
		</div>
	`;
}

/** @param {Event} event */
function filesOf(event) {
	return chosenFiles(/** @type {HTMLInputElement} */ (event.target).files ?? []);
}

/** @param {{chosen: string, choose: (path: string) => void, guess: (format: string) => void}} props */
function FolderList({ chosen, choose, guess }) {
	const [path, setPath] = useState('');
	const [trail, setTrail] = useState(/** @type {string[]} */ ([]));
	const folders = useResource((signal) => getFolders(path, signal), [path]);
	const items = folders.value?.items ?? [];
	const guessed = folders.value?.path === path ? folders.value.format : null;
	useEffect(() => { if (guessed) guess(guessed); }, [guessed]);
	/** @param {MouseEvent} event @param {FolderEntry} entry */
	function enter(event, entry) {
		// The second click of a double click is meant for the same entry, and may meet one of the next list.
		if (event.detail > 1) return;
		choose(entry.path);
		if (!entry.folder) return;
		setTrail([...trail, path]);
		setPath(entry.path);
	}
	/** @param {MouseEvent} event */
	function back(event) {
		if (event.detail > 1) return;
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
						<button class="folders__entry" type="button" aria-pressed=${entry.path === chosen} onClick=${(/** @type {MouseEvent} */ event) => enter(event, entry)}>${entry.name}${entry.folder ? '/' : ''}</button>
					</li>`)}
			</ul>
			${folders.value?.more ? html`<small>The folder contains more entries than are listed here.</small>` : null}
			${folders.value && items.length === 0 && trail.length === 0 ? html`<small>The operator has allowed no folder (TOUCHLINE_IMPORT_FOLDERS) and named no store (TOUCHLINE_STORES).</small>` : null}
		</div>
	`;
}

/**
 * `guess`: what the files most likely are; `videos`: sends files of this computer, where videos are wanted.
 *
 * @param {{onSource: (source: ImportSource | null) => void, guess: (format: string) => void, videos?: (props: {dropped: Promise<PathFile[]> | null, over: boolean}) => any}} props
 */
export function SourceChoice({ onSource, guess, videos }) {
	const [kind, setKind] = useState('upload');
	const [folder, setFolder] = useState('');
	const [dropped, setDropped] = useState(/** @type {Promise<PathFile[]> | null} */ (null));
	/** @param {string} next @param {Promise<PathFile[]> | null} [files] */
	function change(next, files = null) {
		setKind(next);
		setDropped(files);
		onSource(next === 'folder' && folder ? { folder } : null);
	}
	const over = useDrop((files) => change('upload', files));
	return html`
		<fieldset class="choice import__choice">
			<legend>Source</legend>
			<label><input type="radio" name="source" checked=${kind === 'upload'} onChange=${() => change('upload')} /><span>Files on this computer<small>${videos ? 'videos, which are uploaded' : 'zip, JSON, CSV or pictures'}</small></span></label>
			<label><input type="radio" name="source" checked=${kind === 'folder'} onChange=${() => change('folder')} /><span>A ${videos ? 'file' : 'folder'} on the server<small>${videos ? 'the file stays there' : 'or in an object store; frames stay there'}</small></span></label>
		</fieldset>
		${kind === 'upload' && videos ? html`<${videos} dropped=${dropped} over=${over} />` : null}
		${kind === 'upload' && !videos
			? html`<${DropField} dropped=${dropped} over=${over} onUploaded=${(/** @type {UploadJson | null} */ sent) => {
				onSource(sent && { upload: sent.id });
				if (sent?.format) guess(sent.format);
			}} />`
			: null}
		${kind === 'folder'
			? html`<${FolderList} chosen=${folder} guess=${guess} choose=${(/** @type {string} */ path) => { setFolder(path); onSource({ folder: path }); }} />`
			: null}
	`;
}
