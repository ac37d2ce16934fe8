// @ts-check
/** Which findings still ask for a look. */

/** @import {FindingJson, SolutionJson} from '../api/types.js' */

/** The findings that nobody has dismissed. @param {SolutionJson | null | undefined} solution @returns {FindingJson[]} */
export function openFindings(solution) {
	return (solution?.findings ?? []).filter(({ dismissed }) => !dismissed);
}

/**
 * A solution that was computed while somebody drags, with the dismissals of the saved one: the server
 * decides when the edit is saved whether a finding still says the same.
 *
 * @template {SolutionJson | null} T @param {T} solution @param {SolutionJson | null | undefined} saved @returns {T}
 */
export function withDismissals(solution, saved) {
	if (!solution || solution === saved || !saved?.findings.some(({ dismissed }) => dismissed)) return solution;
	const findings = solution.findings.map((finding) => {
		const same = saved.findings.find(({ kind, view, marking, suggested }) => (
			kind === finding.kind && view === finding.view && marking === finding.marking && suggested === finding.suggested
		));
		return { ...finding, dismissed: finding.dismissed ?? same?.dismissed ?? null };
	});
	return { ...solution, findings };
}
