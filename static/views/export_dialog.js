// @ts-check
/** Export: which format, which groups, and the file. */

import { html } from 'htm/preact';
import { useEffect, useRef, useState } from 'preact/hooks';

import { getFormats } from '../api/exports.js';
import { withForm } from '../lib/field.js';
import { count, counted, plural } from '../lib/format.js';
import { useResource } from '../lib/resource.js';
import { dataset, loadDatasets } from '../state/datasets.js';
import { download, FORMATS, makeExport } from '../state/exports.js';
import { JobProgress } from './job_progress.js';

/** @import {JobJson} from '../api/jobs.js' */
/** @import {DatasetJson, ExportJson} from '../api/types.js' */
/** @import {VersionJson} from '../api/versions.js' */

/** @typedef {{items: {format: string, reason: string | null, options: string[]}[]}} Formats */

/**
 * The formats: one that has no place for the groups says why and cannot be chosen; while the server checks, none can.
 *
 * @param {{answers: Formats | undefined, checking: boolean, chosen: string, choose: (name: string) => void}} props
 */
function FormatChoice({ answers, checking, chosen, choose }) {
	const reasons = new Map(answers?.items.map(({ format, reason }) => [format, reason]));
	return html`
		<fieldset class="choice" aria-busy=${checking}>
			<legend>Format${checking ? ' · checking…' : ''}</legend>
			${FORMATS.map(({ name, label, note }) => {
				const reason = reasons.get(name);
				return html`
					<label key=${name} data-disabled=${checking || Boolean(reason)} title=${reason ?? undefined}>
						<input type="radio" name="format" value=${name} checked=${chosen === name} disabled=${checking || Boolean(reason)} onChange=${() => choose(name)} />
						<span>${label}<small>${reason ? `Not possible: ${reason}` : note}</small></span>
					</label>`;
			})}
		</fieldset>
	`;
}

/** @param {{legend: string, name: string, options: {name: string, label: string, note: string}[], why?: string, onChoose?: (name: string) => void}} props `why` nothing can be chosen */
function Choice({ legend, name, options, why = '', onChoose = () => {} }) {
	return html`
		<fieldset class="choice" title=${why || undefined}>
			<legend>${legend}</legend>
			${options.map((option, i) => html`
				<label key=${option.name} data-disabled=${why !== ''}>
					<input type="radio" name=${name} value=${option.name} defaultChecked=${i === 0} disabled=${why !== ''} onChange=${() => onChoose(option.name)} />
					<span>${option.label}<small>${option.note}</small></span>
				</label>`)}
		</fieldset>
	`;
}

/** @param {DatasetJson} one */
function groupChoices(one) {
	return [
		{ name: 'accepted', label: `Accepted groups · ${count(one.accepted)}`, note: 'groups that people accepted' },
		{ name: 'all', label: `All groups · ${count(one.groups)}`, note: 'with the verdict in a column, if the format has one' },
	];
}

const BOXES = [
	{ name: 'optimized', label: 'Optimised boxes', note: 'consistent with the 3D ball' },
	{ name: 'annotated', label: 'Annotated boxes', note: 'as people drew them' },
	{ name: 'exact', label: 'Exact outlines', note: 'tight around the ball’s image' },
];

/** @param {{made: ExportJson}} props */
function Result({ made }) {
	const counts = Object.entries(made.counts ?? {}).map(([name, n]) => counted(n, name));
	return html`
		<p class="export__result" role="status">
			${made.incomplete ? 'Export finished, but incomplete' : 'Ready'}${counts.length ? `: ${counts.join(', ')}` : ''}.
			${made.incomplete ? html`${' '}<strong data-grade="warn">${made.incomplete}.</strong>${' '}` : null}
			<a href=${made.content} download>Download again</a>
		</p>
	`;
}

/** @param {{one: DatasetJson, version?: VersionJson | null, onClose: () => void}} props `version`: its groups, as they were frozen */
export function ExportDialog({ one, version = null, onClose }) {
	const dialog = useRef(/** @type {HTMLDialogElement | null} */ (null));
	const closed = useRef(new AbortController());
	const [state, setState] = useState(
		/** @type {{busy: boolean, job: JobJson | null, made: ExportJson | null, error: string | null}} */
		({ busy: false, job: null, made: null, error: null }),
	);
	useEffect(() => {
		dialog.current?.showModal();
		loadDatasets();
		return () => closed.current.abort();
	}, []);
	const [all, setAll] = useState(false);
	const [wanted, setWanted] = useState(FORMATS[0].name);
	const formats = useResource((signal) => getFormats(one.id, version ? { version: version.id } : {}, signal), [one.id, version?.id]);
	const checking = !formats.value && !formats.error;
	const reasons = formats.value?.items ?? [];
	/** @param {string} name */
	const isPossible = (name) => !reasons.some(({ format, reason }) => format === name && reason);
	const chosen = isPossible(wanted) ? wanted : FORMATS.find(({ name }) => isPossible(name))?.name ?? wanted;
	const used = reasons.find(({ format }) => format === chosen)?.options;
	/** Why the chosen format has no use for an option; empty: it has. @param {string} option @param {string} sentence */
	const unused = (option, sentence) => (used && !used.includes(option) ? sentence : '');
	const noFrames = unused('images', 'This format contains no frames');
	const noViews = unused('views', 'Only COCO and YOLO leave out unconfirmed balls');
	const none = !version && !all && one.accepted === 0 && chosen !== 'touchline' ? 'No group is accepted yet' : '';
	const why = state.busy ? 'Under way' : checking ? 'Checking which formats are possible' : isPossible(chosen) ? none : reasons.find(({ format }) => format === chosen)?.reason ?? '';
	// Who asks while the formats are checked is answered then.
	const [asked, setAsked] = useState(/** @type {FormData | null} */ (null));
	useEffect(() => {
		if (checking || !asked) return;
		setAsked(null);
		void send(asked);
	}, [checking, asked]);
	/** @param {FormData} form */
	async function send(form) {
		if (checking) setAsked(form);
		if (why) return;
		setState({ busy: true, job: null, made: null, error: null });
		try {
			const made = await makeExport({
				dataset: one.name,
				format: chosen,
				all: form.get('groups') === 'all',
				boxes: String(form.get('boxes') ?? BOXES[0].name),
				images: form.get('images') ? 'copy' : 'none',
				views: form.get('views') ? 'all' : 'valid',
				version: version?.name ?? null,
			}, (job) => setState((before) => ({ ...before, job })), closed.current.signal);
			// Whoever closed the dialog finds the export among the jobs.
			if (closed.current.signal.aborted) return;
			setState({ busy: false, job: null, made, error: null });
			if (made.content) download(made.content);
		} catch (error) {
			if (closed.current.signal.aborted) return;
			setState({ busy: false, job: null, made: null, error: error instanceof Error ? error.message : String(error) });
		}
	}
	return html`
		<dialog class="dialog" ref=${dialog} aria-labelledby="export-title" onClose=${onClose}>
			<form onSubmit=${withForm(send)}>
				<header class="dialog__header">
					<h2 id="export-title">Export ${one.name}${version ? `, version ${version.name}` : ''}</h2>
					<button class="button" type="button" onClick=${() => dialog.current?.close()}>Close <kbd>Esc</kbd></button>
				</header>
				<div class="export">
					<${FormatChoice} answers=${formats.value} checking=${checking} chosen=${chosen} choose=${setWanted} />
					<div class="export__column">
						${version ? html`<p class="note">${plural(version.counts.groups, 'group')} as frozen: always the same bytes.</p>`
							: html`<${Choice} legend="Groups" name="groups" options=${groupChoices(one)} onChoose=${(/** @type {string} */ name) => setAll(name === 'all')} />`}
						<${Choice} legend="Ball boxes" name="boxes" options=${BOXES} why=${unused('boxes', 'This format contains no ball boxes')} />
						<label class="form__check" data-disabled=${noFrames !== ''} title=${noFrames || undefined}><input type="checkbox" name="images" disabled=${noFrames !== ''} />Copy the frames into the zip</label>
						<label class="form__check" data-disabled=${noViews !== ''} title=${noViews || undefined}><input type="checkbox" name="views" disabled=${noViews !== ''} />COCO and YOLO: include balls that no other view confirms</label>
					</div>
				</div>
				${state.job ? html`<${JobProgress} job=${state.job} />` : null}
				${state.error ? html`<p class="export__error" role="alert">${state.error}</p>` : null}
				${state.made ? html`<${Result} made=${state.made} />` : null}
				${none ? html`<p class="note">${none}: accept groups, or export all.</p>` : null}
				<p class="dialog__buttons">
					<button class="button button--primary" type="submit" aria-disabled=${why !== ''} title=${why}>${state.busy || asked ? 'Exporting…' : 'Export'}</button>
				</p>
			</form>
		</dialog>
	`;
}

export function ExportButton() {
	const [open, setOpen] = useState(false);
	const one = dataset.value;
	if (!one) return null;
	return html`
		<button data-needs="review" class="button" type="button" onClick=${() => setOpen(true)}>Export…</button>
		${open ? html`<${ExportDialog} one=${one} onClose=${() => setOpen(false)} />` : null}
	`;
}
