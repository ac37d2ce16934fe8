// @ts-check
/** Import: format, source, options; first tried, then done. */

import { html } from 'htm/preact';
import { useEffect, useState } from 'preact/hooks';

import { postImport } from '../api/imports.js';
import { sentenceOf } from '../api/problem.js';
import { withTick, withValue } from '../lib/field.js';
import { param } from '../lib/router.js';
import { datasets, loadDatasets } from '../state/datasets.js';
import { IMPORT_FORMATS, optionValue, withFormat, withOption, withSourceKind } from '../state/import_formats.js';
import { follow, isOver } from '../state/jobs.js';
import { pageAddress } from './dataset_menu.js';
import { ImportReport } from './import_report.js';
import { JobProgress, toneOf } from './job_progress.js';
import { PageFrame } from './page_frame.js';
import { SourceChoice, UploadField } from './source_choice.js';

/** @import {ImportSource, UploadJson} from '../api/imports.js' */
/** @import {JobJson} from '../api/jobs.js' */
/** @import {FormatOption, ImportChoice} from '../state/import_formats.js' */

const POLICIES = [
	{ name: '', label: 'automatic: touchline if most views have a picture, otherwise paper' },
	{ name: 'touchline', label: 'touchline: cameras from the paint of the pictures, noise estimated' },
	{ name: 'paper', label: 'paper: cameras from the annotated lines, thresholds and noise of the paper' },
	{ name: 'strict', label: 'strict: as paper, with rays 5° apart and σ below 0.5 m' },
];

/** Which pictures are one group; nothing is said where each is one. @param {{option: FormatOption, change: (value: any) => void}} props */
function GroupingField({ option, change }) {
	const [how, setHow] = useState('');
	const [pattern, setPattern] = useState('{instant}_{camera}.jpg');
	/** @param {string} next @param {string} names */
	function tell(next, names) {
		setHow(next);
		setPattern(names);
		change(next === 'pattern' ? names : next || undefined);
	}
	return html`
		<div class="form__row">
			<label for="option-grouping">${option.label}</label>
			<select class="field" id="option-grouping" onChange=${withValue((next) => tell(next, pattern))}>
				<option value="">each picture is a group</option><option value="folder">the pictures of a folder are one group</option><option value="pattern">by their names</option>
			</select>
			${how === 'pattern' ? html`<input class="field" id="option-pattern" aria-label="Pattern of the names" autocomplete="off" maxlength="200" value=${pattern} onInput=${withValue((names) => tell(how, names))} />` : null}
			<small>${how === 'pattern' ? option.hint : 'A group is one instant, seen by one camera or more. The dry run shows the resulting groups.'}</small>
		</div>
	`;
}

/** @param {{option: FormatOption, apart: boolean, change: (value: any) => void}} props `apart`: lines are files of their own, which may be of another day */
function OptionField({ option, apart, change }) {
	const id = `option-${option.name}`;
	if (option.kind === 'grouping') return html`<${GroupingField} option=${option} change=${change} />`;
	if (option.kind === 'switch') {
		return html`
			<div class="form__row">
				<label class="form__check"><input type="checkbox" defaultChecked=${true} onChange=${withTick((on) => change(on ? undefined : false))} /><span>${option.label}<small>${option.hint}</small></span></label>
			</div>
		`;
	}
	if (option.kind === 'calibration') {
		return html`
			<div class="form__row">
				<label for=${id}>${option.label}</label>
				<select class="field" id=${id} onChange=${withValue((choice) => change(choice || undefined))}>
					<option value="">the given camera${apart ? '; lines check it' : ''}</option>
					${apart ? html`<option value="given">the given camera; lines are ignored</option>` : null}
					<option value="lines">the lines</option>
				</select>
			</div>
		`;
	}
	return html`
		<div class="form__row">
			<label for=${id}>${option.label}</label>
			<input class="field" id=${id} autocomplete="off" onInput=${withValue((text) => change(optionValue(option, text)))} />
			<small>${option.hint}</small>
		</div>
	`;
}

/** Lines of static cameras are files of their own. @param {{kind: ImportChoice['kind'], change: (lines: ImportSource | undefined) => void}} props */
function LinesField({ kind, change }) {
	const label = 'Line files of the cameras (optional)';
	if (kind === 'folder') {
		return html`
			<div class="form__row">
				<label for="import-lines">${label}</label>
				<input class="field" id="import-lines" autocomplete="off" onInput=${withValue((text) => change(text.trim() ? { folder: text.trim() } : undefined))} />
				<small>another folder that the operator allowed</small>
			</div>
		`;
	}
	return html`<${UploadField} id="import-lines" label=${label} hint="a zip of sn-calibration line files" onUploaded=${(/** @type {UploadJson | null} */ sent) => change(sent ? { upload: sent.id } : undefined)} />`;
}

/** Thresholds of a dataset that the import makes. @param {{policy: string, kept: boolean, change: (policy: string) => void}} props `kept`: the dataset is there */
function PolicyField({ policy, kept, change }) {
	return html`
		<div class="form__row">
			<label for="import-policy">Policy</label>
			<select class="field" id="import-policy" value=${policy} disabled=${kept} title=${kept ? 'This dataset exists already and keeps its policy' : ''} onChange=${withValue(change)}>
				${POLICIES.map(({ name, label }) => html`<option key=${name} value=${name}>${label}</option>`)}
			</select>
			<small>${kept ? 'This dataset already exists and keeps its policy. Change it on the Policy page.' : 'The thresholds of the new dataset, and whether cameras come from the paint of its pictures. It can be changed later.'}</small>
		</div>
	`;
}

/** @param {{format: string, choose: (format: string) => void}} props */
function FormatChoice({ format, choose }) {
	return html`
		<fieldset class="choice import__choice">
			<legend>Format</legend>
			${IMPORT_FORMATS.map(({ name, label, note }) => html`
				<label key=${name}><input type="radio" name="format" checked=${format === name} onChange=${() => choose(name)} /><span>${label}<small>${note}</small></span></label>`)}
		</fieldset>
	`;
}

/** @param {{job: JobJson, dry: boolean, dataset: string}} props */
function Outcome({ job, dry, dataset }) {
	const done = job.state === 'done';
	return html`
		<section class="card form" aria-label="Progress" data-tone=${isOver(job) ? toneOf(job) : undefined}>
			<${JobProgress} job=${job} />
			${isOver(job) && job.result ? html`<${ImportReport} report=${job.result} dry=${dry} dataset=${dataset} />` : null}
			${done && !dry ? html`<p class="buttons"><a class="button button--primary" href=${pageAddress(dataset, 'queue')}>Open the queue</a><a class="button" href=${pageAddress(dataset, 'yield')}>Open the yield page</a></p>` : null}
		</section>
	`;
}

/** One import at a time: the last one, and what went wrong before it could begin. */
function useImport() {
	const [state, setState] = useState(/** @type {{job: JobJson | null, dry: boolean, dataset: string, error: string}} */ ({ job: null, dry: true, dataset: '', error: '' }));
	/** @param {import('../api/imports.js').ImportRequest} body */
	async function run(body) {
		const { dry_run: dry, dataset } = body;
		setState({ job: null, dry, dataset, error: '' });
		try {
			await follow(await postImport(body), (job) => setState({ job, dry, dataset, error: '' }));
			if (!dry) loadDatasets();
		} catch (error) {
			setState({ job: null, dry, dataset, error: sentenceOf(error) });
		}
	}
	return { ...state, run };
}

export function ImportPage() {
	const [dataset, setDataset] = useState(param('dataset'));
	const [choice, setChoice] = useState(/** @type {ImportChoice} */ ({ format: IMPORT_FORMATS[0].name, kind: 'upload', options: {} }));
	const [source, setSource] = useState(/** @type {ImportSource | null} */ (null));
	const [policy, setPolicy] = useState('');
	const { job, dry, dataset: imported, error, run } = useImport();
	useEffect(() => { loadDatasets(); }, []);
	const { format, kind, options } = choice;
	const chosen = IMPORT_FORMATS.find(({ name }) => name === format) ?? IMPORT_FORMATS[0];
	const name = dataset.trim();
	const kept = (datasets.value ?? []).some((one) => one.name === name);
	const busy = job !== null && !isOver(job);
	const why = busy ? 'An import is under way' : !name ? 'Name the dataset first' : !source ? 'Choose a file or folder first' : '';
	/** @param {string} next */
	const choose = (next) => setChoice((before) => withFormat(before, next));
	/** @param {string} option @param {unknown} value */
	const say = (option, value) => setChoice((before) => withOption(before, choice, option, value));
	/** @param {ImportSource | null} next */
	function changeSource(next) {
		setSource(next);
		setChoice((before) => withSourceKind(before, next && 'folder' in next ? 'folder' : 'upload'));
	}
	/** @param {boolean} dry_run */
	function start(dry_run) {
		if (why || !source) return;
		const asked = Object.entries(options).filter(([, value]) => value !== undefined);
		run({ dataset: name, format, source, options: Object.fromEntries(asked), dry_run, ...(policy && !kept && !chosen.keepsPolicy ? { policy } : {}) });
	}
	/** @param {SubmitEvent} event */
	function submit(event) {
		event.preventDefault();
		start(true);
	}
	return html`
		<${PageFrame} current="import" title="Import" where=${html`<strong>Import</strong>`}>
			<div class="page__columns">
				<section class="card" aria-labelledby="import-title">
					<h2 id="import-title">What to import</h2>
					<form class="form" onSubmit=${submit}>
						<div class="form__row">
							<label for="import-dataset">Dataset</label>
							<input class="field" id="import-dataset" list="known-datasets" maxlength="100" autocomplete="off" value=${dataset} onInput=${withValue(setDataset)} />
							<datalist id="known-datasets">${(datasets.value ?? []).map((one) => html`<option key=${one.id} value=${one.name}></option>`)}</datalist>
							<small>A new name makes a new dataset. An import into an existing one updates what has changed in its files; edits of people stay.</small>
						</div>
						<${FormatChoice} format=${format} choose=${choose} />
						<${SourceChoice} onSource=${changeSource} guess=${(/** @type {string} */ guessed) => { if (IMPORT_FORMATS.some((one) => one.name === guessed)) choose(guessed); }} />
						${chosen.options.map((option) => html`<${OptionField} key=${`${format}/${option.name}`} option=${option} apart=${chosen.lines === true} change=${(/** @type {any} */ value) => say(option.name, value)} />`)}
						${chosen.lines ? html`
							<${LinesField} key=${`${format}/${kind}`} kind=${kind} change=${(/** @type {ImportSource | undefined} */ lines) => say('lines', lines)} />` : null}
						${chosen.keepsPolicy ? null : html`<${PolicyField} policy=${policy} kept=${kept} change=${setPolicy} />`}
						<p class="buttons">
							<button data-needs="lead" data-of="" class="button button--primary" type="submit" aria-disabled=${why !== ''} title=${why}>Dry run</button>
							<button data-needs="lead" data-of="" class="button" type="button" aria-disabled=${why !== ''} title=${why} onClick=${() => start(false)}>Import</button>
						</p>
						${error ? html`<p class="form__error" role="alert">${error}</p>` : null}
					</form>
				</section>
				${job ? html`<${Outcome} job=${job} dry=${dry} dataset=${imported} />` : html`
					<section class="card empty"><h2>Start with a dry run</h2><p>A dry run saves nothing. It reads the files and reports what an import would do: what is new, what changed, and every record that cannot be read, with its file and place.</p></section>`}
			</div>
		<//>
	`;
}
