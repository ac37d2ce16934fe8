"""Remedies: the small edits with which a group would pass, each tried out by the solver itself."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from app.features.groups.edit import Edit, SetLines
from app.features.groups.suggested_edits import (
    EditOffer,
    FixGuide,
    describe_condition,
    edit_of_fix,
    find_guide_of_fix,
    list_edits_of_fix,
    move_ball_edit,
    rank_of_fix,
)
from app.features.groups.view_paint import PaintUpdaterWithoutPictures
from app.geometry.arrays import FloatArray
from app.soccer.finding import SuggestedFix
from app.soccer.frames import ImagePoint
from app.soccer.group import Group, View, make_view_letter
from app.soccer.policy import Policy
from app.soccer.solution import Gate, MarkingFit, Solution, ViewSolution
from app.solving.calibrate import compute_paint_search_key, find_wanted_paint_reading
from app.solving.jaccard import project_markings
from app.solving.resect import REFERENCE_DIAGONAL
from app.solving.solve import solve_group
from app.wording import format_pixels

MOST_TRIALS = 24
"""A person waits for the answer; what helps is nearly always among the first."""
MARKINGS_PER_VIEW = 4
_CLICKS = 8
"""As many points a person would put on a marking."""
STUB_PX = 5.0
"""At 960 x 540: shorter stubs of markings are not drawn by people."""
MIN_POINTS_LEFT = 2
MAX_HEIGHT_M = 30.0
MAX_POINT_SLIP_PERCENT = 7.0
MAX_BALL_SLIP_PERCENT = 3.0
"""How far a click can plausibly be off, in per cent of the diagonal; beyond it something else is
wrong, or the ball is another one."""
BETTER_CAUSES = frozenset(
    {
        "sides_swapped",
        "wrong_label",
        "several_balls",
        "under_constrained",
        "picture_geometry",
        "camera_size",
        "paint_disagrees",
        "implausible_camera",
    }
)
"""Findings that explain why rays do not meet: then no ball is moved to make them meet."""
RAY_DEPTHS_M = np.geomspace(1.0, 400.0, 2000)
"""Where balls are looked for along a ray; a step is a third of a per cent of the distance."""


@dataclass(frozen=True)
class Suggestion:
    """What would make a group pass, or bring the gate that fails nearer to passing.

    Attributes:
        gate: The gate that fails now.
        view: View that is edited.
        sentence: The condition under which the group passes, to be read after "would pass if".
        fix: The edit, or (``draw_marking``, ``look_ball``) where a person should look and draw.
        point: Where ``move_point`` puts its point and ``look_ball`` would see the ball, pixels;
            None for other actions.
        offers: The edits that carry it out; none where only a person can.
        guide: Where that person is led.
        value: What the gate would measure; None where paint would have to be read to know.
        passes: Whether the whole group would pass; not where paint would have to be read to know.
    """

    gate: str
    view: str | None
    sentence: str
    fix: SuggestedFix
    point: ImagePoint | None
    offers: tuple[EditOffer, ...]
    guide: FixGuide | None
    value: float | None
    passes: bool


@dataclass(frozen=True)
class _SuggestionCandidate:
    """A suggestion before it is tried."""

    sentence: str
    fix: SuggestedFix
    point: ImagePoint | None = None
    trial: Edit | None = None
    """What a person would draw; None: the fix itself is the edit."""


def find_suggestions(group: Group, policy: Policy, solution: Solution) -> list[Suggestion]:
    """What would make a group pass, the gentlest first; nothing for a group that passes.

    Args:
        group: The group as it is.
        policy: The thresholds.
        solution: Its solution under that policy.
    """
    failing = solution.first_failing
    if failing is None:
        return []
    trials = _Trials(group, policy, solution, failing)
    found = []
    for candidate in _collect_distinct_candidates(group, solution, failing)[:MOST_TRIALS]:
        suggestion = trials.try_candidate(candidate)
        if suggestion is not None:
            found.append((not suggestion.passes, rank_of_fix(candidate.fix), suggestion))
    return [suggestion for *_, suggestion in sorted(found, key=lambda item: item[:2])]


class _Trials:
    """Tries candidates out on a group."""

    def __init__(self, group: Group, policy: Policy, solution: Solution, failing: Gate):
        self._group, self._policy = group, policy
        self._solution, self._failing = solution, failing
        self._known = {view.calibration_key: view.calibration for view in solution.views}
        self._clicked: dict[frozenset[str], Solution] = {}

    def try_candidate(self, candidate: _SuggestionCandidate) -> Suggestion | None:
        """The suggestion, or None where the edit changes nothing for the better.

        Paint is read for the lines that are there. Of other lines it is not read here, for that takes
        long: cameras of clicks are compared then, and nobody knows whether the group would pass.
        """
        group, fix = self._group, candidate.fix
        edit = candidate.trial or edit_of_fix(group, fix, candidate.point)
        if edit is None:
            return None
        edited, reader = edit.apply(group), PaintUpdaterWithoutPictures()
        reader.update_paint(edited, self._policy.calibration, self._known)
        then = solve_group(edited, self._policy, self._known)
        now = self._solve_with_clicks_as(edited)
        before, gate = (
            next(gate for gate in of.gates if gate.name == self._failing.name) for of in (now, then)
        )
        passes = then.passes and not now.passes
        if not passes and not _is_improvement(before, gate, now, then, fix.view):
            return None
        return Suggestion(
            gate=self._failing.name,
            view=fix.view,
            sentence=candidate.sentence,
            fix=fix,
            point=candidate.point,
            offers=list_edits_of_fix(group, fix, candidate.point),
            guide=find_guide_of_fix(fix, candidate.point),
            value=None if reader.missed else gate.value,
            passes=passes and not reader.missed,
        )

    def _solve_with_clicks_as(self, edited: Group) -> Solution:
        """The group as it is, with cameras of clicks where the edited one has them for want of paint."""
        policy = self._policy.calibration
        outdated = frozenset(
            view.key
            for view in edited.views
            for reading in [find_wanted_paint_reading(edited, view, policy)]
            if reading and reading.sought_for != compute_paint_search_key(edited, view, policy)
        )
        if not outdated:
            return self._solution
        if outdated not in self._clicked:
            left = {key: read for key, read in self._group.paint.items() if key not in outdated}
            group = replace(self._group, paint=left)
            self._clicked[outdated] = solve_group(group, self._policy, self._known)
        return self._clicked[outdated]


def _is_improvement(
    before: Gate, after: Gate, now: Solution, then: Solution, view: str | None
) -> bool:
    """Whether the failing gate passes, or the edited view's JaC rises."""
    if after.passed and not before.passed:
        return True
    if before.name != "jac" or view is None:
        return False
    old, new = now.view(view), then.view(view)
    if old is None or new is None or not old.calibration.jac or not new.calibration.jac:
        return False
    return new.calibration.jac[0] > old.calibration.jac[0]


def _collect_distinct_candidates(
    group: Group, solution: Solution, failing: Gate
) -> list[_SuggestionCandidate]:
    """All ideas once, the gentlest first."""
    ideas: dict[SuggestedFix, _SuggestionCandidate] = {}
    for candidate in (
        *_iterate_finding_candidates(group, solution),
        *_iterate_gate_candidates(group, solution, failing),
    ):
        ideas.setdefault(candidate.fix, candidate)
    return sorted(ideas.values(), key=lambda candidate: rank_of_fix(candidate.fix))


def _iterate_finding_candidates(group: Group, solution: Solution) -> Iterator[_SuggestionCandidate]:
    for finding in solution.findings:
        fix = finding.fix
        view = None if fix is None or fix.view is None else group.view(fix.view)
        if fix is not None and view is not None:
            yield _SuggestionCandidate(describe_condition(group, fix), fix)


def _iterate_gate_candidates(
    group: Group, solution: Solution, failing: Gate
) -> Iterator[_SuggestionCandidate]:
    for view in group.views:
        solved = solution.view(view.key)
        if solved is None:
            continue
        if not view.included:
            fix = SuggestedFix("include_view", view.key)
            yield _SuggestionCandidate(describe_condition(group, fix), fix)
        elif solved.failed == "jac":
            yield from _suggest_drawing_or_hiding_markings(group, view, solved)
            yield from _iterate_line_candidates(group, view, solved)
    explained = any(finding.kind in BETTER_CAUSES for finding in solution.findings)
    if failing.name == "reprojection" and not explained:
        yield from _iterate_ball_candidates(group, solution)


def _suggest_drawing_or_hiding_markings(
    group: Group, view: View, solved: ViewSolution
) -> Iterator[_SuggestionCandidate]:
    """Draw what the camera sees and nobody has drawn: all of it, the longest first; stubs that
    nobody can see are said not to be visible, for two clicks anywhere would do as well."""
    # What stands there under a wrong name is relabelled, not drawn again.
    named = {suspect.suggested for suspect in solved.calibration.suspects}
    undrawn = sorted(
        (
            fit
            for fit in solved.calibration.markings
            if _is_undrawn(fit) and fit.marking not in named
        ),
        key=lambda fit: fit.length_px,
        reverse=True,
    )
    camera = solved.calibration.camera
    shortest = STUB_PX * view.size.diagonal / REFERENCE_DIAGONAL
    for fit in undrawn:
        if fit.length_px < shortest:
            hide = SuggestedFix("hide_marking", view.key, fit.marking)
            yield _SuggestionCandidate(
                describe_condition(group, hide, max(fit.length_px, 1.0)), hide
            )
    if camera is None or view.media is None:
        # Without a picture there is nothing to draw along.
        return
    fitted = group.pitch.with_goal_edge(solved.calibration.goal)
    seen = project_markings(camera, fitted, view.size)
    # JaC counts what the evaluator's edges show; of the edges in use the picture may show nothing.
    undrawn = [fit for fit in undrawn if fit.marking in seen]
    if not undrawn or undrawn[0].length_px < shortest:
        return
    letter = make_view_letter(group.views.index(view))
    names = [
        f"{fit.marking} (visible over {format_pixels(max(fit.length_px, 1))})" for fit in undrawn
    ]
    verb = "were" if len(names) > 1 else "was"
    advice = f"{' and '.join(names)} {verb} drawn in {letter}"
    drawn = {fit.marking: _sample_clicks_along_polyline(seen[fit.marking]) for fit in undrawn}
    fix = SuggestedFix("draw_marking", view.key, undrawn[0].marking)
    yield _SuggestionCandidate(advice, fix, trial=SetLines(view.key, drawn))


def _is_undrawn(fit: MarkingFit) -> bool:
    return fit.outcome == "fp" and not fit.distances_px


def _sample_clicks_along_polyline(polyline: FloatArray) -> tuple[ImagePoint, ...]:
    return tuple(map(ImagePoint._make, polyline[:: len(polyline) // _CLICKS + 1].tolist()))


def _iterate_line_candidates(
    group: Group, view: View, solved: ViewSolution
) -> Iterator[_SuggestionCandidate]:
    """Move or drop the worst point, or drop the marking, for each marking that does not count."""
    off = [
        fit
        for fit in solved.calibration.markings
        if fit.outcome != "tp" and _largest_point_distance_px(fit)
    ]
    for fit in sorted(off, key=_largest_point_distance_px, reverse=True)[:MARKINGS_PER_VIEW]:
        index = max(range(len(fit.distances_px)), key=fit.distances_px.__getitem__)
        for action in ("move_point", "drop_point", "drop_marking"):
            if action == "drop_point" and len(fit.distances_px) <= MIN_POINTS_LEFT:
                continue
            fix = SuggestedFix(
                action, view.key, fit.marking, index=None if action == "drop_marking" else index
            )
            slip = MAX_POINT_SLIP_PERCENT / 100 * view.size.diagonal
            if action == "move_point" and fit.distances_px[index] > slip:
                continue
            point = fit.nearest[index] if action == "move_point" else None
            yield _SuggestionCandidate(
                describe_condition(group, fix, fit.distances_px[index]), fix, point
            )


def _iterate_ball_candidates(group: Group, solution: Solution) -> Iterator[_SuggestionCandidate]:
    """Look for the ball where the other view's ray passes, in either view of a pair.

    Nobody moves it there by a key: a ball that is put onto a ray meets it, right or wrong.
    """
    for pair in solution.pairs:
        for moved, other in ((pair.a, pair.b), (pair.b, pair.a)):
            view = group.view(moved)
            point = _find_ball_nearest_to_ray(group, solution, moved, other)
            if view is None or point is None or view.ball is None or view.ball.center is None:
                continue
            apart = math.dist(point, view.ball.center)
            if apart > MAX_BALL_SLIP_PERCENT / 100 * view.size.diagonal:
                continue
            fix = SuggestedFix("look_ball", moved, to=other)
            trial = move_ball_edit(moved, view.ball, point)
            yield _SuggestionCandidate(describe_condition(group, fix, apart), fix, point, trial)


def _find_ball_nearest_to_ray(
    group: Group, solution: Solution, moved: str, other: str
) -> ImagePoint | None:
    """The place nearest to a view's ball where a ball on the other view's ray would be seen."""
    views = [group.view(key) for key in (moved, other)]
    solved = [solution.view(key) for key in (moved, other)]
    cameras = [None if one is None else one.calibration.camera for one in solved]
    centers = [None if one is None or one.ball is None else one.ball.center for one in views]
    camera, ray_camera = cameras
    center, ray_center = centers
    if camera is None or ray_camera is None or center is None or ray_center is None:
        return None
    ray = ray_camera.rays(np.array([ray_center]))[0]
    places = ray_camera.position + RAY_DEPTHS_M[:, None] * ray
    over_pitch = (places[:, 2] <= 0) & (places[:, 2] >= -MAX_HEIGHT_M)
    pixels = camera.project(places[over_pitch])
    pixels = pixels[np.isfinite(pixels).all(axis=1)]
    if not len(pixels):
        return None
    nearest = pixels[np.argmin(np.hypot(*(pixels - np.array(center)).T))]
    return ImagePoint(float(nearest[0]), float(nearest[1]))


def _largest_point_distance_px(fit: MarkingFit) -> float:
    return max(fit.distances_px, default=0.0)
