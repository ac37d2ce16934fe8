"""Lesson words: what a practice group asks, hints at, and says once it has been answered."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class LessonWords:
    """The texts of one lesson; ``{view}`` stands for the letter of the view with the fault.

    Attributes:
        question: What to look for, without giving the answer away.
        hint: Where to look, for somebody who is stuck.
        fault: What was wrong, said once the group is judged.
        best: What to do about it, and with which keys.
    """

    question: str
    hint: str
    fault: str
    best: str


WORDS = {
    "clean": LessonWords(
        question="Read the card with the result and compare it with the pictures. Would you let this group "
        "into the dataset?",
        hint="Look at the blue lines on the white paint and at the ball in the small pictures "
        "below. When both fit in every view, nothing is wrong.",
        fault="Nothing is wrong with this group: every line lies on its paint and the views agree "
        "on one ball.",
        best="Press A to accept it.",
    ),
    "wrong_label": LessonWords(
        question="The field lines of one view do not fit. Find out why before you decide.",
        hint="Compare the names: click a red line to read its marking. Is that "
        "the line that you see?",
        fault="In view {view} the line called “{marking}” is really “{true_marking}”.",
        best="Press Enter: it gives the line its right name, as the card says. Then press A.",
    ),
    "swapped_sides": LessonWords(
        question="Each view fits its own lines. Do they show the ball at the same place of the "
        "pitch?",
        hint="Look at the small pitch below: on which side does each camera stand, and which goal "
        "do the views show? Replays are sometimes labelled from the other end.",
        fault="In view {view} left and right are exchanged in every label.",
        best="Press Enter: it swaps left and right in view {view}. Then press A.",
    ),
    "bad_point": LessonWords(
        question="One click of an annotator went astray. Find it.",
        hint="Follow the error lines: they lead from the line to each annotated point, and one is "
        "much longer than the others.",
        fault="In view {view} a point of “{marking}” lies beside its line.",
        best="Press Enter to do what the card offers, Shift Enter for another way (or drag the "
        "point onto the paint). Then press A.",
    ),
    "missing_ball": LessonWords(
        question="The views are calibrated, and still there is no 3D ball. What is missing?",
        hint="Look at the small ball pictures below: does every view have a ball? Where the rays "
        "of the other views cross the picture is where to search.",
        fault="Nobody marked the ball in view {view}, although it can be seen.",
        best="Press Enter, click the ball on the dotted line in view {view}, then press A.",
    ),
    "undrawn_line": LessonWords(
        question="This group fails because of its field lines, but no annotated line looks wrong. "
        "What else counts?",
        hint="Look for white paint that carries a thin dotted line and no points: it can be seen, "
        "and nobody annotated it. Such lines count as missed.",
        fault="In view {view} nobody annotated {markings}, although they can be seen.",
        best="Press Enter: it leads to the line with its name chosen. Click two points on the "
        "paint and press Escape. When the card says that the group passes, press A.",
    ),
    "not_synchronous": LessonWords(
        question="Every view is calibrated and has a ball, and yet they do not meet in one point. "
        "Look at the players.",
        hint="Compare how the players stand around the ball in each view. Is it the same moment?",
        fault="View {view} shows another moment: the ball had moved {amount:.1f} m.",
        best="No edit can fix that. Press X, then Enter for “Not the same instant”; where two other "
        "views agree you may leave view {view} out with Shift X instead, and accept the rest.",
    ),
    "tiny_baseline": LessonWords(
        question="Everything fits, and still the group cannot be used. Where do the cameras stand?",
        hint="Look at the small pitch below: how far are the cameras from each other? Two views "
        "from one place say nothing about depth.",
        fault="Both cameras stand at nearly one place: view {view} is beside the main camera.",
        best="No edit can fix that. Press X, then Enter for “Duplicate view”.",
    ),
}
"""By the kind of the lesson."""
