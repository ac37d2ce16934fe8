// @ts-check
/** Pictures of a match: whether what is proposed for them is new. */

/** @import {MatchPictureJson} from '../api/match_estimates.js' */
/** @import {PictureJson} from '../api/types.js' */

/**
 * Whether a proposal says something that not all frames of a match have.
 * @param {Pick<MatchPictureJson, 'picture' | 'mixed'>} one
 * @param {PictureJson | null} proposed
 * @returns {boolean}
 */
export function isNewPicture(one, proposed) {
	return proposed !== null && (one.mixed || JSON.stringify(proposed) !== JSON.stringify(one.picture));
}
