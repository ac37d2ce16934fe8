// @ts-check
/** The column beside the views: the result, its reasons, the verdict. */

import { html } from 'htm/preact';

import { lazy } from '../lib/lazy.js';
import { isPractice } from '../state/datasets.js';
import { Findings } from './findings.js';
import { FollowCard, isFollowing } from './follow_parts.js';
import { Gates } from './gates.js';
import { PairTable } from './pair_table.js';
import { PredictionCard } from './prediction_parts.js';
import { ProposalCard } from './proposal_parts.js';
import { VerdictButtons } from './verdict_buttons.js';
import { VerdictCard } from './verdict_card.js';
import { ViewLines } from './view_lines.js';
import { ViewTable } from './view_table.js';

/** @import {GroupDocument, SolutionJson} from '../api/types.js' */
/** @import {ViewPicture} from '../overlays/scene.js' */

const FirstSteps = lazy(async () => (await import('./first_steps.js')).FirstSteps);
const CommentsCard = lazy(async () => (await import('./comments/comments_card.js')).CommentsCard);
const TrackCard = lazy(async () => (await import('./track_card.js')).TrackCard);
const LessonCard = lazy(async () => (await import('./lesson_card.js')).LessonCard);

/**
 * @param {{
 *   group: GroupDocument, solution: SolutionJson | null, pictures: ViewPicture[], live: boolean
 * }} props
 */
export function Rail({ group, solution, pictures, live }) {
	return html`
		<aside class="rail" aria-label="About this group">
			<div class="rail__scroll" tabindex="0" role="group" aria-label="Numbers">
				${isPractice(group.dataset.name) ? html`<${LessonCard} group=${group} />` : null}
				<${VerdictCard} group=${group} solution=${solution} live=${live} />
				${isFollowing() ? html`<${FollowCard} />` : null}
				${solution ? html`<${Gates} group=${group} solution=${solution} />` : null}
				<${ViewTable} group=${group} pictures=${pictures} />
				${pictures.some(({ predictions }) => predictions) ? html`<${PredictionCard} group=${group} />` : null}
				${pictures.some(({ proposal }) => proposal) ? html`<${ProposalCard} pictures=${pictures} />` : null}
				${solution ? html`
					<${PairTable} group=${group} solution=${solution} />
					<${Findings} group=${group} solution=${solution} />
				` : null}
				<${TrackCard} />
				<${ViewLines} group=${group} pictures=${pictures} />
				<${CommentsCard} group=${group} />
				<${FirstSteps} dataset=${group.dataset.name} />
			</div>
			<${VerdictButtons} group=${group} />
		</aside>
	`;
}
