"""Lessons: eight groups to learn on, each with one known fault or none; what a lesson asks, hints at and says, and whether
it was answered rightly.

The numbers are chosen so that every lesson shows its problem under the policy ``paper``; the
ordinary sample does not know them.
"""

from __future__ import annotations

import zipfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from app.features.groups.state import VerdictState
from app.formats.soccernet_v3 import ARCHIVE
from app.formats.soccernet_v3_writer import write_soccernet_v3
from app.json_text import json_text
from app.progress import ReportProgress
from app.sample.faults import FaultPlan
from app.sample.render import render_view
from app.sample.scene import (
    TRUTH,
    PlantedFault,
    Scene,
    SceneTruth,
    TruthWriter,
    ViewTruth,
    truth_to_json,
)
from app.sample.scenes import MatchSetup, make_match_setup, make_scene
from app.sample.write import JPEG_QUALITY, ZIP_DATE
from app.soccer.group import Group, View, make_view_letter

SEED = 20_260_808
MATCH_GROUPS = 800
"""Groups that the match of the lessons has; most of them are never made."""
CLEAN = "clean"
"""Kind of a lesson without a fault."""


@dataclass(frozen=True)
class LessonRecipe:
    """Which scene a lesson is made of.

    Attributes:
        kind: ``CLEAN``, or one of ``PRACTICE_KINDS``.
        number: Number of the scene; lessons stand in the order of their numbers.
        view: Place of the view that carries the fault.
        seed: Seed of the fault.
    """

    kind: str
    number: int
    view: int = 0
    seed: int = 0


LESSONS = (
    LessonRecipe(CLEAN, 3),
    LessonRecipe("wrong_label", 102, view=1, seed=1),
    LessonRecipe("swapped_sides", 201, view=1),
    LessonRecipe("bad_point", 368, view=0, seed=1),
    LessonRecipe("missing_ball", 401, view=1),
    LessonRecipe("not_synchronous", 503, view=1, seed=1),
    LessonRecipe("undrawn_line", 618, view=0, seed=1),
    LessonRecipe("tiny_baseline", 701, view=1, seed=1),
)


def make_practice_scenes() -> list[Scene]:
    """The scenes of all lessons, in their order."""
    stage = make_practice_match()
    return [make_scene(stage, lesson.number, _fault_plan_of_lesson(lesson)) for lesson in LESSONS]


def make_practice_match() -> MatchSetup:
    """The match that all lessons are from."""
    return make_match_setup(0, MATCH_GROUPS, SEED)


def _fault_plan_of_lesson(lesson: LessonRecipe) -> FaultPlan | None:
    if lesson.kind == CLEAN:
        return None
    return FaultPlan(lesson.kind, lesson.view, lesson.seed)


def write_practice(out: Path, progress: ReportProgress | None = None) -> None:
    """Write the lessons as a SoccerNet-v3 tree with ``truth.json`` beside it.

    What an earlier call left there is replaced by the same bytes.

    Args:
        out: Folder, made when missing.
        progress: Called after each frame.
    """
    scenes = make_practice_scenes()
    out.mkdir(parents=True, exist_ok=True)
    write_soccernet_v3(out, [scene.group for scene in scenes])
    _write_frames(out / scenes[0].fixture.folder / ARCHIVE, scenes, progress)
    temporary = out / f".{TRUTH}.part"
    with temporary.open("w", encoding="utf-8") as stream:
        writer = TruthWriter(stream, SEED)
        writer.write(
            (scene.truth.key, json_text(truth_to_json(scene.truth), compact=True))
            for scene in scenes
        )
        writer.close()
    # The truth comes last: where it is, everything is.
    temporary.replace(out / TRUTH)


def _write_frames(archive: Path, scenes: list[Scene], progress: ReportProgress | None) -> None:
    frames = [(scene, view.key) for scene in scenes for view in scene.group.views]
    temporary = archive.with_suffix(".part")
    with zipfile.ZipFile(temporary, "w", zipfile.ZIP_STORED) as members:
        for done, (scene, key) in enumerate(frames, start=1):
            quality = [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY]
            _, content = cv2.imencode(".jpg", render_view(scene, key), quality)
            members.writestr(zipfile.ZipInfo(key, ZIP_DATE), content.tobytes())
            if progress is not None:
                progress(done, len(frames))
    temporary.replace(archive)


@dataclass(frozen=True)
class LessonTemplates:
    """The texts of one lesson; ``{view}`` stands for the letter of the view with the fault.

    Attributes:
        question: What to look for, without giving the answer away.
        hint: A hint where to look.
        fault: What was wrong, said once the group is judged.
        best: What to do about it, and with which keys.
    """

    question: str
    hint: str
    fault: str
    best: str


WORDS = {
    "clean": LessonTemplates(
        question="Read the card with the result and compare it with the pictures. Would you let this group "
        "into the dataset?",
        hint="Look at the blue lines on the white paint and at the ball in the small pictures below "
        "or beside the views. When both fit in every view, nothing is wrong.",
        fault="Nothing is wrong with this group: every line lies on its paint and the views agree "
        "on one ball.",
        best="Press A to accept it.",
    ),
    "wrong_label": LessonTemplates(
        question="The field lines of one view do not fit. Find out why before you decide.",
        hint="Compare the names: beside the yellow line stand its marking and the one that would fit. "
        "Which of them is the line that you see?",
        fault="In view {view} the line called “{marking}” is really “{true_marking}”.",
        best="Press Enter: it gives the line its right name, as the card says. Then press A.",
    ),
    "swapped_sides": LessonTemplates(
        question="Each view fits its own lines. Do they show the ball at the same place of the "
        "pitch?",
        hint="Look at the small pitch below or beside the views: on which side does each camera "
        "stand, and which goal do the views show? Replays are sometimes labelled from the other end.",
        fault="In view {view} left and right are exchanged in every label.",
        best="Press Enter: it swaps left and right in view {view}. Then press A.",
    ),
    "bad_point": LessonTemplates(
        question="One click of an annotator went astray. Find it.",
        hint="Follow the error lines: they lead from the line to each annotated point, and one is "
        "much longer than the others.",
        fault="In view {view} a point of “{marking}” lies beside its line.",
        best="Press Enter to do what the card offers, Shift Enter for another way (or drag the "
        "point onto the paint). Then press A.",
    ),
    "missing_ball": LessonTemplates(
        question="The views are calibrated, and still there is no 3D ball. What is missing?",
        hint="Look at the small ball pictures below or beside the views: does every view have a "
        "ball? Where the rays of the other views cross the picture is where to search.",
        fault="The ball can be seen in view {view}, but is not annotated there.",
        best="Press Enter, click the ball on the dotted line in view {view}, then press A.",
    ),
    "undrawn_line": LessonTemplates(
        question="This group fails because of its field lines, but no annotated line looks wrong. "
        "What else counts?",
        hint=(
            "Look for white paint with a thin dotted line and no points: it is visible, but not "
            "annotated. Such lines count as missed."
        ),
        fault="{markings} can be seen in view {view}, but are not annotated there.",
        best="Press Enter: it leads to the line with its name chosen. Click two points on the "
        "paint and press Escape. When the card says that the group passes, press A.",
    ),
    "not_synchronous": LessonTemplates(
        question="Every view is calibrated and has a ball, and yet they do not meet in one point. "
        "Look at the players.",
        hint="Compare how the players stand around the ball in each view. Is it the same moment?",
        fault="View {view} shows another moment: the ball had moved {amount:.1f} m.",
        best="No edit can fix that. Press X, then Enter for “Not the same instant”; where two other "
        "views agree you may leave view {view} out with Shift X instead, and accept the rest.",
    ),
    "tiny_baseline": LessonTemplates(
        question="Everything fits, and still the group cannot be used. Where do the cameras stand?",
        hint="Look at the small pitch below or beside the views: how far are the cameras from each "
        "other? Two views from one place say nothing about depth.",
        fault="Both cameras stand at nearly one place: view {view} is beside the main camera.",
        best="No edit can fix that. Press X, then Enter for “Duplicate view”.",
    ),
}
"""By the kind of the lesson."""


OPEN, MENDED, RIGHT, ALMOST, WRONG = "open", "mended", "right", "almost", "wrong"
OFF_PX = 12.0
"""An annotated point farther from the paint than this is a mistake; clicks are off by one or two."""
BALL_OFF_SHARE, BALL_OFF_PX = 0.75, 6.0
"""A ball farther from where it was is a mistake: a share of its diameter, and at least pixels."""
_REASONS = {"not_synchronous": "not_same_instant", "tiny_baseline": "duplicate_view"}
"""Lessons that no edit can mend, with the reason that says why."""


@dataclass(frozen=True)
class Feedback:
    """What is said about an answer.

    Attributes:
        state: ``open`` (not answered), ``mended`` (edited rightly, not yet judged), ``right``,
            ``almost`` or ``wrong``.
        sentence: In words; None while the lesson is open.
        best: What would have been best, once the lesson is judged; None before.
    """

    state: str
    sentence: str | None = None
    best: str | None = None


def find_lesson_kind(truth: SceneTruth) -> str:
    """The kind of a lesson: that of its fault, or ``clean``."""
    return truth.faults[0].kind if truth.faults else CLEAN


def judge_lesson(truth: SceneTruth, group: Group, verdict: VerdictState) -> Feedback:
    """The feedback on a practice group in its present state.

    Args:
        truth: Of the group, with its planted faults.
        group: As it was edited.
        verdict: The newest one; a stale one counts as none.
    """
    words = _LessonTexts(truth, group)
    if verdict.state == "unreviewed" or verdict.stale:
        return _judge_unreviewed(truth, group, words)
    if verdict.state == "deferred":
        return words.make_feedback(
            ALMOST, "You deferred this group. That is fine when you are not sure."
        )
    if verdict.state == "accepted":
        return _judge_accepted(truth, group, words)
    return _judge_rejected(truth, verdict.reason, words)


def _judge_unreviewed(truth: SceneTruth, group: Group, words: _LessonTexts) -> Feedback:
    kind = find_lesson_kind(truth)
    if kind == CLEAN:
        return Feedback(OPEN)
    if _is_fault_corrected(truth, group):
        return Feedback(
            MENDED, f"Right: {words.corrected_fault_sentence} Press A to accept the group."
        )
    if _list_mislabelled_views(truth, group):
        letter = make_view_letter(_view_index(group, _list_mislabelled_views(truth, group)[0]))
        return Feedback(
            OPEN,
            f"Look again: view {letter} was labelled correctly, and now its sides are swapped. "
            "Ctrl Z undoes that.",
        )
    return Feedback(OPEN)


def _judge_accepted(truth: SceneTruth, group: Group, words: _LessonTexts) -> Feedback:
    kind = find_lesson_kind(truth)
    if kind == CLEAN:
        if _is_annotation_correct(truth, group):
            return words.make_feedback(RIGHT, "")
        return words.make_feedback(WRONG, "The group was correct before your edit.")
    if kind not in _REASONS and _is_fault_corrected(truth, group):
        return words.make_feedback(RIGHT, "You fixed it.")
    if kind != "tiny_baseline" and _is_faulty_view_excluded(truth, group):
        if kind == "not_synchronous":
            return words.make_feedback(RIGHT, "You left that view out, and the others agree.")
        return words.make_feedback(
            ALMOST, "Leaving the view out works, but the view could be fixed and is lost now."
        )
    return words.make_feedback(WRONG, "You accepted the group with its fault.")


def _judge_rejected(truth: SceneTruth, reason: str | None, words: _LessonTexts) -> Feedback:
    kind = find_lesson_kind(truth)
    if kind == CLEAN:
        return words.make_feedback(WRONG, "You rejected a good group.")
    if kind not in _REASONS:
        return words.make_feedback(WRONG, "The group could have been fixed, and you rejected it.")
    if reason == _REASONS[kind]:
        return words.make_feedback(RIGHT, "Your reason is right, too.")
    return words.make_feedback(
        ALMOST, "It is right to reject this group, but another reason fits better."
    )


class _LessonTexts:
    """The sentences of a lesson, with letters and numbers put in."""

    def __init__(self, truth: SceneTruth, group: Group):
        self._words = WORDS[find_lesson_kind(truth)]
        self._values = _make_fault_text_values(truth.faults, group)

    @property
    def corrected_fault_sentence(self) -> str:
        """The sentence about a planted fault that was corrected."""
        return f"the fault is fixed. {self.fault_sentence}"

    @property
    def fault_sentence(self) -> str:
        """The sentence about the planted fault."""
        return self._words.fault.format(**self._values)

    def make_feedback(self, state: str, remark: str) -> Feedback:
        """The feedback on a verdict."""
        begins = {RIGHT: "Right:", ALMOST: "Nearly:", WRONG: "Look again:"}[state]
        parts = [part for part in (remark, self.fault_sentence) if part]
        first = parts[0][0].lower() + parts[0][1:] if parts[0].startswith(_PLAIN) else parts[0]
        sentence = " ".join([begins, first, *parts[1:]])
        return Feedback(state, sentence, self._words.best.format(**self._values))


_PLAIN = ("You ", "Your ", "The ", "It ", "A ", "Leaving ", "Nothing ")
"""Beginnings that are written small behind a colon."""


def _make_fault_text_values(faults: Sequence[PlantedFault], group: Group) -> dict[str, object]:
    if not faults:
        return {}
    first = faults[0]
    return {
        "view": make_view_letter(_view_index(group, first.view)),
        "marking": first.marking,
        "true_marking": first.true_marking,
        "amount": first.amount or 0.0,
        "markings": " and ".join(f"“{fault.marking}”" for fault in faults),
    }


def _view_index(group: Group, view: str) -> int:
    return [item.key for item in group.views].index(view)


def _is_fault_corrected(truth: SceneTruth, group: Group) -> bool:
    """Whether the fault is gone and nothing else was spoilt."""
    if find_lesson_kind(truth) in _REASONS or not _is_annotation_correct(truth, group):
        return False
    view = group.view(truth.faults[0].view)
    if view is None or not view.included:
        return False
    if find_lesson_kind(truth) == "missing_ball":
        return view.ball is not None and view.ball.center is not None
    if find_lesson_kind(truth) == "undrawn_line":
        # One line of two is enough for the gate, and the card then says that the group passes.
        return any(fault.marking in view.station.lines for fault in truth.faults)
    return True


def _is_faulty_view_excluded(truth: SceneTruth, group: Group) -> bool:
    """Whether the view with the fault is left out and two sound ones remain."""
    faulty = {fault.view for fault in truth.faults}
    used = [view for view in group.views if view.included]
    with_ball = [view for view in used if view.ball is not None]
    gone = not any(view.key in faulty for view in used)
    return gone and len(with_ball) >= 2 and _is_annotation_correct(truth, group)


def _is_annotation_correct(truth: SceneTruth, group: Group) -> bool:
    """Whether all that is annotated in the views in use is where it was in truth."""
    for view in group.views:
        known = truth.view(view.key)
        if not view.included or known is None:
            continue
        if list_misplaced_lines(known, view, group) or _is_ball_misplaced(known, view):
            return False
    return True


def list_misplaced_lines(truth: ViewTruth, view: View, group: Group) -> tuple[str, ...]:
    """Markings of a view with a point that does not lie where the marking really is."""
    off = []
    for marking, points in view.station.lines.items():
        curve = truth.camera.project(group.pitch.sample(marking, 0.1, 0.1))
        curve = curve[np.isfinite(curve).all(axis=1)]
        away = [
            float(np.hypot(*(curve - np.array(point)).T).min()) if len(curve) else np.inf
            for point in points
        ]
        if max(away) > OFF_PX:
            off.append(marking)
    return tuple(off)


def _list_mislabelled_views(truth: SceneTruth, group: Group) -> list[str]:
    """Views without a fault of their own in which nearly no line is where it is named."""
    faulty = {fault.view for fault in truth.faults}
    turned = []
    for view in group.views:
        known = truth.view(view.key)
        if known is None or view.key in faulty or not view.station.lines:
            continue
        if len(list_misplaced_lines(known, view, group)) > 0.5 * len(view.station.lines):
            turned.append(view.key)
    return turned


def _is_ball_misplaced(truth: ViewTruth, view: View) -> bool:
    if view.ball is None or view.ball.center is None:
        return False
    away = np.hypot(*np.subtract(view.ball.center, truth.ball_box.center))
    return bool(away > max(BALL_OFF_PX, BALL_OFF_SHARE * truth.ball_diameter_px))
