// @ts-check
/** Instants: frames that become groups, chosen one by one or every so many of a shot. */

import { html } from 'htm/preact';
import { useRef, useState } from 'preact/hooks';

import { postInstants } from '../../api/recordings.js';
import { useAttempt } from '../../lib/attempt.js';
import { withForm, withTick } from '../../lib/field.js';
import { plural } from '../../lib/format.js';
import { isOver, jobToShow } from '../../state/jobs.js';
import { queueAddress } from '../../state/navigation.js';
import { wanted } from '../../state/playback.js';
import { everyOf } from '../../state/shots.js';
import { FormError } from '../form_error.js';
import { JobProgress } from '../job_progress.js';

/** @import {JobJson} from '../../api/jobs.js' */
/** @import {LinkJson, RecordingJson, Shot} from '../../api/recordings.js' */
/** @import {RunningJobs} from '../running_jobs.js' */

/** @typedef {{chosen: ReadonlySet<number>, turn: (frame: number) => void, add: (frames: number[]) => void, clear: () => void}} Instants */

/** What became of them, in words. @param {JobJson['result']} result */
function madeText({ new: made, changed, unchanged, linked_views: views, outside, dry_run: dry }) {
	return [
		dry ? 'Dry run, nothing was saved. The result would be:' : '',
		`${plural(made, 'group')} created.`,
		changed ? `${plural(changed, 'group')} got views of replays.` : '',
		unchanged ? `${plural(unchanged, 'frame')} ${unchanged === 1 ? 'was already a group and was not changed' : 'were already groups and were not changed'}.` : '',
		views ? `${plural(views, 'view')} of linked replays added.` : '',
		outside ? `${plural(outside, 'view')} missing, because the replay does not show the instant.` : '',
	].filter(Boolean).join(' ');
}

/** @param {{one: RecordingJson, running: RunningJobs, shot: Shot | undefined, instants: Instants, links: LinkJson[]}} props */
export function InstantsCard({ one, running: { jobs, watch }, shot, instants, links }) {
	const [propose, setPropose] = useState(true);
	const [linked, setLinked] = useState(true);
	const usable = links.filter(({ live, map }) => live.recording === one.id && map.outcome === 'linked').length;
	const job = jobToShow(jobs.filter(({ kind }) => kind === 'instants'));
	const { error, attempt } = useAttempt();
	const { chosen } = instants;
	const present = useRef(chosen);
	present.current = chosen;
	const busy = job !== null && !isOver(job);
	const why = busy ? 'Groups are being made' : chosen.size === 0 ? 'Choose an instant first' : '';
	const every = withForm((said) => { if (shot) instants.add(everyOf(shot, Number(said.get('step')))); });
	/** @param {boolean} dry */
	function make(dry) {
		if (why) return;
		const sent = chosen;
		attempt(postInstants(one.id, [...sent], { propose, linked: linked && usable > 0, dry_run: dry }), async (begun) => {
			const over = await watch(begun);
			if (over.state !== 'done' || dry) return;
			// Others were chosen meanwhile, and wait for the next time.
			const others = [...present.current].filter((frame) => !sent.has(frame));
			instants.clear();
			instants.add(others);
		});
	}
	const query = `match:"${one.name.replaceAll('"', '')}"`;
	return html`
		<section class="card form" aria-label="Instants">
			<h2>Instants<span class="card__aside">${plural(chosen.size, 'frame')} chosen</span></h2>
			<p class="buttons">
				<button class="button" type="button" aria-pressed=${chosen.has(wanted.value)} onClick=${() => instants.turn(wanted.value)}>Choose this frame <kbd>I</kbd></button>
				<button class="button" type="button" aria-disabled=${chosen.size === 0} onClick=${instants.clear}>Clear</button>
			</p>
			<form class="buttons" onSubmit=${every}>
				<label for="instants-step">Every</label>
				<input class="field film__step" id="instants-step" name="step" type="number" min="1" max="100000" required defaultValue=${Math.round(one.fps ?? 25)} />
				<span>frames</span>
				<button class="button" type="submit" title="Choose every N-th frame of this shot as an instant">Choose</button>
			</form>
			<label class="form__check"><input type="checkbox" checked=${propose} onChange=${withTick(setPropose)} />Propose cameras afterwards</label>
			${usable ? html`<label class="form__check"><input type="checkbox" checked=${linked} onChange=${withTick(setLinked)} />With the views of ${plural(usable, 'linked replay')}</label>` : null}
			<p class="buttons"><button class="button button--primary" type="button" data-needs="lead" data-of=${one.dataset} aria-disabled=${why !== ''} title=${why} onClick=${() => make(false)}>Make ${chosen.size ? plural(chosen.size, 'group') : 'groups'}</button>
				<button class="button" type="button" data-needs="lead" data-of=${one.dataset} aria-disabled=${why !== ''} title=${why || 'Counts what would be made, and saves nothing'} onClick=${() => make(true)}>Dry run</button></p>
			${error ? html`<${FormError} error=${error} />` : null}
			${job ? html`<${JobProgress} job=${job} />` : null}
			${job?.state === 'done' ? html`<p role="status">${madeText(job.result)}</p>` : null}
			${one.groups ? html`<p><a class="link" href=${queueAddress(one.dataset, query)}>${plural(one.groups, 'group')} of this recording</a></p>` : null}
		</section>
	`;
}
