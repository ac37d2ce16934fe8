"""Lines for a view that has none, or why there are none."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest

from app.errors import GeometryError
from app.paint import view_proposal
from app.paint.propose import propose_camera
from app.paint.view_proposal import (
    NOTHING_NEW,
    ViewProposal,
    keep_undrawn_markings,
    propose_lines_in_image,
)
from app.soccer.annotation import Lines, make_lines
from app.soccer.choices import GoalEdge
from app.soccer.frames import ImagePoint, ImageSize
from app.soccer.paint_evidence import POINTS_PER_MARKING
from app.soccer.pitch import Pitch, opposite_marking
from app.soccer.policy import PAPER, CalibrationPolicy
from app.solving.calibrate import calibrate
from tests.cameras import SIZE
from tests.unit.applications import lines_of
from tests.unit.paint.lawns import PITCH, SMALL, TRUE, drawn, lawn

POLICY = PAPER.calibration


def test_the_lines_make_the_camera_that_drew_the_picture() -> None:
    # Annotated at another size than the picture has.
    size = ImageSize(1920, 1080)
    found = propose_lines_in_image(lawn(drawn(TRUE, 3)), size, (), PITCH, POLICY)
    assert (found.outcome, found.sentence) == ("proposed", "")
    assert max(map(len, found.lines.values())) <= POINTS_PER_MARKING
    camera = calibrate(found.lines, PITCH, size, POLICY).camera
    assert camera is not None
    corner = np.array([[36.0, -20.0, 0.0]])
    assert np.hypot(*(camera.project(corner) - TRUE.scaled(2, 2).project(corner))[0]) < 3.0


def test_its_numbers_are_those_of_the_search_in_pixels_of_the_annotations() -> None:
    image = lawn(drawn(TRUE, 3))
    search = propose_camera(image, PITCH, (), POLICY)
    found = propose_lines_in_image(image, ImageSize(1920, 1080), (), PITCH, POLICY)
    assert search.agreement is not None and search.snapped is not None
    told = (found.supported, found.explained, found.runner_up, found.points)
    assert told == (
        search.agreement.supported,
        search.agreement.explained,
        search.runner_up,
        search.snapped.point_count,
    )
    assert search.snapped.error_px
    assert found.error_px == pytest.approx(2 * search.snapped.error_px)


def test_a_picture_that_cannot_be_solved_gets_a_sentence(monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: object) -> None:
        raise GeometryError("nothing meets")

    monkeypatch.setattr(view_proposal, "propose_camera", fail)
    found = propose_lines_in_image(lawn(drawn(TRUE, 3)), SMALL, (), PITCH, POLICY)
    assert (found.outcome, found.lines) == ("nothing", {})
    assert found.sentence == "No camera can be computed from the paint of this picture."


def test_cameras_of_other_frames_are_what_is_tried_first(monkeypatch: pytest.MonkeyPatch) -> None:
    tried: list[object] = []

    def keep(_image: object, _pitch: object, known: object, _policy: object) -> None:
        tried.append(known)
        raise GeometryError("that was all")

    monkeypatch.setattr(view_proposal, "propose_camera", keep)
    propose_lines_in_image(lawn(drawn(TRUE, 3)), SMALL, (TRUE,), PITCH, POLICY)
    assert tried == [(TRUE,)]


def test_an_empty_lawn_gets_none_and_a_sentence() -> None:
    found = propose_lines_in_image(lawn(np.zeros((540, 960), np.bool_)), SMALL, (), PITCH, POLICY)
    assert (found.outcome, found.lines) == ("nothing", {})
    assert found.sentence.endswith(".") and found.sentence[0].isupper()


def test_a_single_line_is_unsure() -> None:
    mask = np.zeros((540, 960), np.uint8)
    cv2.line(mask, (100, 300), (800, 350), 1, 3)
    found = propose_lines_in_image(lawn(mask.astype(np.bool_)), SMALL, (), PITCH, POLICY)
    assert found.outcome == "unsure"
    assert found.lines == {} and found.sentence


@pytest.mark.parametrize(("goal", "sought"), [("middle", "inner"), ("laws", "laws")])
def test_a_policy_whose_lines_lie_by_the_laws_is_followed(
    monkeypatch: pytest.MonkeyPatch, goal: GoalEdge, sought: GoalEdge
) -> None:
    tried: list[str] = []

    def keep(_image: object, pitch: Pitch, *_: object) -> None:
        tried.append(pitch.goal)
        raise GeometryError("that was all")

    monkeypatch.setattr(view_proposal, "propose_camera", keep)
    propose_lines_in_image(lawn(drawn(TRUE, 3)), SMALL, (), PITCH, replace(POLICY, goal=goal))
    assert tried == [sought]


SEEN = lines_of(TRUE.scaled(4 / 3, 4 / 3))
FOUND = ViewProposal("proposed", "", SEEN, 0.9, 0.8, 0.3, 0.25, 500)
DEFAULT_POLICY = CalibrationPolicy()


def beside(drawn: Lines) -> ViewProposal:
    return keep_undrawn_markings(FOUND, drawn, PITCH, SIZE, DEFAULT_POLICY)


def only(*markings: str) -> Lines:
    return make_lines({name: SEEN[name] for name in markings})


def test_without_drawn_lines_all_is_proposed() -> None:
    assert beside({}) is FOUND
    nothing = replace(FOUND, outcome="nothing", lines={})
    assert keep_undrawn_markings(nothing, SEEN, PITCH, SIZE, DEFAULT_POLICY) is nothing


def test_drawn_markings_are_not_proposed_again() -> None:
    found = beside(only("Side line right"))
    assert found.sentence == ""
    assert dict(found.lines) == {
        name: points for name, points in SEEN.items() if name != "Side line right"
    }
    assert replace(found, lines=SEEN) == FOUND


def test_drawn_lines_say_which_half_is_seen() -> None:
    drawn = {
        opposite_marking(name): SEEN[name] for name in ("Side line right", "Big rect. right main")
    }
    found = beside(make_lines(drawn))
    assert found.sentence == ""
    assert "Side line bottom" in found.lines and "Side line top" not in found.lines
    assert found.lines["Side line bottom"] == SEEN["Side line top"]


def test_what_is_drawn_elsewhere_is_named_and_left() -> None:
    moved = [ImagePoint(point.x, point.y + 60.0) for point in SEEN["Big rect. right main"]]
    drawn = make_lines({**only("Side line right"), "Big rect. right main": moved})
    found = beside(drawn)
    assert found.outcome == "proposed"
    assert "“Big rect. right main” is drawn up to " in found.sentence
    assert "Side line right" not in found.sentence
    assert not set(drawn) & set(found.lines)


def test_what_the_camera_does_not_see_is_named() -> None:
    drawn = make_lines({**only("Side line right"), "Side line left": SEEN["Side line top"]})
    assert "“Side line left” is drawn where the proposed camera does not see it" in (
        beside(drawn).sentence
    )


def test_where_all_is_drawn_already_nothing_is_proposed() -> None:
    found = beside(SEEN)
    assert (found.outcome, dict(found.lines), found.sentence) == ("unsure", {}, NOTHING_NEW)
