"""The edits that a finding or a suggestion proposes.

An influence is what a camera would be without one of its markings.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

from app.features.groups.edit import (
    Edit,
    SetBalls,
    SetLines,
    SetPictureGeometry,
    SetViewInclusion,
    make_set_ball_edit,
)
from app.geometry.camera import Camera
from app.soccer.annotation import BallAnnotation, remove_markings
from app.soccer.finding import Finding, FindingWithBallPlace, SuggestedFix
from app.soccer.frames import Box, ImagePoint
from app.soccer.group import Group, Station, View, make_view_letter
from app.soccer.picture import OPEN
from app.soccer.pitch import Pitch, opposite_marking
from app.soccer.policy import CalibrationPolicy
from app.soccer.solution import GAMMAS_PERCENT
from app.solving.calibrate import calibrate_station, min_counted_marking_px
from app.solving.calibration_findings import READ_PAINT
from app.solving.jaccard import (
    classify_markings,
    find_unannotated_not_missing,
    jaccard,
    measure_markings,
    project_markings,
    project_markings_like_evaluator,
)


@dataclass(frozen=True)
class EditOffer:
    """An edit that carries a fix out, the words on its button and those beside what it changes."""

    label: str
    edit: Edit
    caption: str = ""


@dataclass(frozen=True)
class FixGuide:
    """Where a person is led who has to look or draw: what no edit can do for them.

    Attributes:
        label: On its button.
        caption: Words beside the place in the picture.
        draws: The marking to draw.
        looks: Where the ball would have to be, pixels of the annotated size.
        reads: Whether the picture is to be read again, with those of its match.
    """

    label: str
    caption: str = ""
    draws: str | None = None
    looks: ImagePoint | None = None
    reads: bool = False


def list_edits_of_fix(
    group: Group, fix: SuggestedFix | None, point: ImagePoint | None = None
) -> tuple[EditOffer, ...]:
    """The edits that carry out a fix: none when only a person can, several to choose from.

    Args:
        group: The group that the fix is about.
        fix: What to do; None: nothing is proposed.
        point: Where ``move_point`` puts its point, pixels of the annotated size.
    """
    view = None if fix is None or fix.view is None else group.view(fix.view)
    if fix is None or view is None:
        return ()
    action = _ACTIONS[fix.action]
    found = ((one, action.edit(view, one, point)) for one in _list_fix_choices(view, fix))
    return tuple(
        EditOffer(
            _format_button_text(action.label, one), edit, _format_button_text(action.caption, one)
        )
        for one, edit in found
        if edit
    )


def find_guide_of_fix(fix: SuggestedFix | None, point: ImagePoint | None = None) -> FixGuide | None:
    """Where a fix leads a person; None where an edit carries it out.

    Args:
        fix: What to do; None: nothing is proposed.
        point: Where ``look_ball`` would see the ball, pixels of the annotated size.
    """
    if fix is None or fix.action not in _GUIDES:
        return None
    action = _ACTIONS[fix.action]
    reads = fix.action == READ_PAINT
    return FixGuide(action.label, action.caption, fix.marking, point, reads)


def list_edits_of_finding(group: Group, finding: Finding) -> tuple[EditOffer, ...]:
    """The edits that mend what a finding says: those of its fix, or its ball's box fitted."""
    if finding.kind == "ball_size":
        return _offer_fitted_box(group, finding)
    if isinstance(finding, FindingWithBallPlace):
        return _offer_edits_for_ball_off_track(group, finding)
    return list_edits_of_fix(group, finding.fix)


def find_guide_of_finding(finding: Finding) -> FixGuide | None:
    """Where a finding leads a person; None where it offers edits, or nothing."""
    if finding.kind == "visible_not_annotated":
        return find_guide_of_fix(SuggestedFix("draw_marking", finding.view, finding.marking))
    return find_guide_of_fix(finding.fix)


def edit_of_fix(group: Group, fix: SuggestedFix, point: ImagePoint | None = None) -> Edit | None:
    """The one edit that carries out a fix; None when only a person can, or has to choose."""
    found = list_edits_of_fix(group, fix, point)
    return found[0].edit if len(found) == 1 else None


def rank_of_fix(fix: SuggestedFix) -> int:
    """Grows with what a fix takes away: mending what is wrong comes before leaving it out."""
    return _ACTIONS[fix.action].rank


def describe_condition(group: Group, fix: SuggestedFix, moved_px: float = 0.0) -> str:
    """The condition under which the group passes, to be read after "would pass if"."""
    letter = make_view_letter([view.key for view in group.views].index(fix.view or ""))
    return _format_button_text(_ACTIONS[fix.action].sentence, fix, letter=letter, px=moved_px)


def move_ball_edit(view: str, ball: BallAnnotation, point: ImagePoint) -> SetBalls:
    """The edit that puts a view's ball somewhere else, as large as it is."""
    if ball.box is None:
        return make_set_ball_edit(view, replace(ball, point=point))
    box = ball.box
    moved = replace(box, x=point.x - box.width / 2, y=point.y - box.height / 2)
    return make_set_ball_edit(view, replace(ball, box=moved))


def _offer_edits_for_ball_off_track(
    group: Group, finding: FindingWithBallPlace
) -> tuple[EditOffer, ...]:
    """The ball at the place of the track, another ball of the view, or the view left out."""
    key = finding.view
    view = None if key is None else group.view(key)
    place = None if finding.place is None else ImagePoint(*finding.place)
    moved = (
        list_edits_of_fix(group, SuggestedFix("move_ball", key), place) if place is not None else ()
    )
    others = () if view is None else _list_fix_choices(view, SuggestedFix("pick_ball", key))
    picked = [offer for fix in others if fix.index for offer in list_edits_of_fix(group, fix)]
    return (*moved, *picked, *list_edits_of_fix(group, SuggestedFix("exclude_view", key)))


def _offer_fitted_box(group: Group, finding: Finding) -> tuple[EditOffer, ...]:
    """A box as large as the ball looks at its distance; the number is how many times as large it is now."""
    view = None if finding.view is None else group.view(finding.view)
    ball = None if view is None else view.ball
    if view is None or ball is None or ball.box is None or not finding.number:
        return ()
    box = Box.square(ball.box.center, ball.box.diameter / finding.number)
    return (EditOffer("Fit the box", make_set_ball_edit(view.key, replace(ball, box=box))),)


def _format_button_text(text: str, fix: SuggestedFix, **more: str | float) -> str:
    number = None if fix.index is None else fix.index + 1
    return text.format(marking=fix.marking, to=fix.to, number=number, **more)


def _list_fix_choices(view: View, fix: SuggestedFix) -> list[SuggestedFix]:
    """The fix, or one for each ball of which one has to be picked."""
    if fix.action != "pick_ball" or fix.index is not None:
        return [fix]
    seen = [index for index, ball in enumerate(view.balls) if not ball.out_of_view]
    return [replace(fix, index=index) for index in seen] if len(seen) > 1 else []


def _no_edit(_view: View, _fix: SuggestedFix, _point: ImagePoint | None) -> Edit | None:
    return None


def _include_view_edit(view: View, fix: SuggestedFix, _point: ImagePoint | None) -> Edit | None:
    return SetViewInclusion(view.key, fix.action == "include_view")


def _pick_ball_edit(view: View, fix: SuggestedFix, _point: ImagePoint | None) -> Edit | None:
    there = fix.index is not None and fix.index < len(view.balls)
    return make_set_ball_edit(view.key, view.balls[fix.index or 0]) if there else None


def _move_ball_edit(view: View, _fix: SuggestedFix, point: ImagePoint | None) -> Edit | None:
    ball = next((one for one in view.balls if not one.out_of_view), None)
    return None if point is None or ball is None else move_ball_edit(view.key, ball, point)


def _swap_sides_edit(view: View, _fix: SuggestedFix, _point: ImagePoint | None) -> Edit | None:
    """Every marking under the name that it has when the pitch turns by 180 degrees."""
    lines = view.station.lines
    changes: dict[str, tuple[ImagePoint, ...] | None] = dict.fromkeys(lines)
    for marking, points in lines.items():
        changes[opposite_marking(marking)] = tuple(points)
    # What is not visible is the other end of the pitch, too.
    unseen = tuple(map(opposite_marking, view.station.not_visible))
    for marking in (*view.station.not_visible, *unseen):
        changes.setdefault(marking, None)
    return SetLines(view.key, changes, not_visible=unseen) if changes else None


def _estimate_picture_geometry_edit(
    view: View, _fix: SuggestedFix, _point: ImagePoint | None
) -> Edit | None:
    """Its own lines say what was done to the picture; that of a static camera belongs to no view."""
    return None if view.station.shared else SetPictureGeometry(view.key, OPEN)


def _relabel_marking_edit(view: View, fix: SuggestedFix, _point: ImagePoint | None) -> Edit | None:
    lines = view.station.lines
    if fix.to is None or fix.marking is None or fix.marking not in lines:
        return None
    merged = (*lines.get(fix.to, ()), *lines[fix.marking])
    return SetLines(view.key, {fix.marking: None, fix.to: merged})


def _delete_marking_edit(view: View, fix: SuggestedFix, _point: ImagePoint | None) -> Edit | None:
    if fix.marking is None or fix.marking not in view.station.lines:
        return None
    return SetLines(view.key, {fix.marking: None})


def _mark_not_visible_edit(view: View, fix: SuggestedFix, _point: ImagePoint | None) -> Edit | None:
    if fix.marking is None or fix.marking in view.station.lines:
        return None
    return SetLines(view.key, {fix.marking: None}, not_visible=(fix.marking,))


def _move_point_edit(view: View, fix: SuggestedFix, point: ImagePoint | None) -> Edit | None:
    return None if point is None else _replace_point_edit(view, fix, (point,))


def _delete_point_edit(view: View, fix: SuggestedFix, _point: ImagePoint | None) -> Edit | None:
    return _replace_point_edit(view, fix, ())


def _replace_point_edit(
    view: View, fix: SuggestedFix, instead: tuple[ImagePoint, ...]
) -> Edit | None:
    points = tuple(view.station.lines.get(fix.marking or "", ()))
    if fix.marking is None or fix.index is None or not fix.index < len(points):
        return None
    left = (*points[: fix.index], *instead, *points[fix.index + 1 :])
    return SetLines(view.key, {fix.marking: left or None})


@dataclass(frozen=True)
class _FixAction:
    """What an action of fixes means.

    Attributes:
        sentence: What would have to be so; empty where whoever proposes it says more.
        label: On its button.
        caption: Beside what it is about in the picture.
        edit: Makes the edit of a view; None where the fix does not fit it.
    """

    rank: int
    sentence: str = ""
    label: str = ""
    caption: str = ""
    edit: Callable[[View, SuggestedFix, ImagePoint | None], Edit | None] = _no_edit


_ACTIONS = {
    "relabel": _FixAction(
        0,
        "{marking} in {letter} was relabelled as {to}",
        "Relabel as {to}",
        "{marking} → {to}",
        _relabel_marking_edit,
    ),
    "swap_sides": _FixAction(
        0,
        "left and right were swapped in {letter}",
        "Swap left and right",
        "Left and right swapped?",
        _swap_sides_edit,
    ),
    "pick_ball": _FixAction(
        0,
        "ball {number} was the one in play in {letter}",
        "Keep ball {number}",
        edit=_pick_ball_edit,
    ),
    "move_ball": _FixAction(
        1,
        "the ball of {letter} was where its track is seen",
        "Move the ball there",
        "is the ball here?",
        _move_ball_edit,
    ),
    "free_picture": _FixAction(
        1,
        "the picture of {letter} was stretched or cropped",
        "Use this geometry",
        edit=_estimate_picture_geometry_edit,
    ),
    "move_point": _FixAction(
        1,
        "point {number} of {marking} in {letter} moved {px:.1f} px",
        "Move the point",
        "point {number} of {marking}",
        _move_point_edit,
    ),
    "look_ball": _FixAction(
        1,
        "the ball of {letter} was really {px:.1f} px away, on the ray of the other view",
        "Show the place",
        "is the ball here?",
    ),
    "hide_marking": _FixAction(
        2,
        "{marking} in {letter}, which is {px:.0f} px long there, was marked as not visible",
        "Mark as not visible",
        "{marking}: not visible?",
        _mark_not_visible_edit,
    ),
    "draw_marking": _FixAction(2, label="Draw it"),
    READ_PAINT: _FixAction(1, label="Read its paint"),
    "include_view": _FixAction(
        2, "{letter} was included again", "Include it again", edit=_include_view_edit
    ),
    "drop_point": _FixAction(
        3,
        "point {number} of {marking} in {letter} was deleted",
        "Delete the point",
        "point {number} of {marking}",
        _delete_point_edit,
    ),
    "drop_marking": _FixAction(
        4,
        "{marking} in {letter} was deleted",
        "Delete the line",
        "{marking}: fits no line",
        _delete_marking_edit,
    ),
    "exclude_view": _FixAction(5, "{letter} was left out", "Leave it out", edit=_include_view_edit),
}
_GUIDES = frozenset(name for name, action in _ACTIONS.items() if action.edit is _no_edit)
"""Actions that no edit carries out."""


@dataclass(frozen=True)
class MarkingInfluence:
    """One marking's influence on the camera of its view.

    Attributes:
        marking: The marking.
        jac: JaC of the view as it is, for each of ``GAMMAS_PERCENT``; None without a camera.
        jac_without: JaC of the other markings by a camera that never saw this one; None when no
            camera is left.
        largest_px: Largest distance of its points from the camera as it is.
        largest_px_without: The same from the camera that never saw the marking.
    """

    marking: str
    jac: tuple[float, ...] | None
    jac_without: tuple[float, ...] | None
    largest_px: float | None
    largest_px_without: float | None


def measure_marking_influences(
    station: Station, pitch: Pitch, policy: CalibrationPolicy
) -> list[MarkingInfluence]:
    """The influence of each annotated marking, by refitting without it.

    Args:
        station: Camera whose lines are asked about; a given camera is not looked at.
        pitch: The pitch.
        policy: How lines become a camera.
    """
    station = replace(station, given=None, given_covariance=None)
    whole = calibrate_station(station, pitch, policy)
    largest = {fit.marking: max(fit.distances_px) for fit in whole.markings if fit.distances_px}
    doubted = {suspect.marking for suspect in whole.suspects}
    # Wrong labels are known by now: they are left out of every refit and not sought again.
    trusting = replace(policy, check_labels=False)
    found = []
    for marking in station.lines:
        used = remove_markings(station.lines, {marking, *doubted})
        rest = calibrate_station(replace(station, lines=used), pitch, trusting).camera
        jac, error = (
            (None, None)
            if rest is None
            else _measure_fit_without_marking(rest, marking, station, pitch, policy)
        )
        found.append(MarkingInfluence(marking, whole.jac, jac, largest.get(marking), error))
    return found


def _measure_fit_without_marking(
    camera: Camera, marking: str, station: Station, pitch: Pitch, policy: CalibrationPolicy
) -> tuple[tuple[float, ...], float | None]:
    """JaC of the other markings, and the largest distance of this one."""
    pitch, size, lines = policy.pitch_for_fitted_lines(pitch), station.size, station.lines
    measured = measure_markings(project_markings(camera, pitch, size), lines)
    judged = project_markings_like_evaluator(camera, pitch, size, lines, measured)
    for short in find_unannotated_not_missing(
        judged, lines, station.not_visible, min_counted_marking_px(policy, size)
    ):
        del judged[short]
    values = []
    for gamma in GAMMAS_PERCENT:
        found = classify_markings(judged, lines, gamma / 100 * size.diagonal)
        found.pop(marking, None)
        values.append(jaccard(found))
    seen = measured.get(marking) or judged.get(marking)
    return tuple(values), None if seen is None else float(seen.distances.max())
