"""Lines for a view that has none, or why there are none."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest

from app.errors import GeometryError
from app.paint import view_proposal
from app.paint.propose import propose
from app.paint.view_proposal import proposal_of
from app.soccer.frames import ImageSize
from app.soccer.paint_evidence import POINTS_PER_MARKING
from app.soccer.pitch import GoalEdge, Pitch
from app.soccer.policy import PAPER
from app.solving.calibrate import calibrate
from tests.unit.paint.lawns import PITCH, SMALL, TRUE, drawn, lawn

POLICY = PAPER.calibration


def test_the_lines_make_the_camera_that_drew_the_picture() -> None:
    # Annotated at another size than the picture has.
    size = ImageSize(1920, 1080)
    found = proposal_of(lawn(drawn(TRUE, 3)), size, (), PITCH, POLICY)
    assert (found.outcome, found.sentence) == ("proposed", "")
    assert max(map(len, found.lines.values())) <= POINTS_PER_MARKING
    camera = calibrate(found.lines, PITCH, size, POLICY).camera
    assert camera is not None
    corner = np.array([[36.0, -20.0, 0.0]])
    assert np.hypot(*(camera.project(corner) - TRUE.scaled(2, 2).project(corner))[0]) < 3.0


def test_its_numbers_are_those_of_the_search_in_pixels_of_the_annotations() -> None:
    image = lawn(drawn(TRUE, 3))
    search = propose(image, PITCH, (), POLICY)
    found = proposal_of(image, ImageSize(1920, 1080), (), PITCH, POLICY)
    assert search.agreement is not None and search.snapped is not None
    told = (found.supported, found.explained, found.runner_up, found.points)
    assert told == (
        search.agreement.supported,
        search.agreement.explained,
        search.runner_up,
        search.snapped.points,
    )
    assert search.snapped.error_px
    assert found.error_px == pytest.approx(2 * search.snapped.error_px)


def test_a_picture_that_cannot_be_solved_gets_a_sentence(monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: object) -> None:
        raise GeometryError("nothing meets")

    monkeypatch.setattr(view_proposal, "propose", fail)
    found = proposal_of(lawn(drawn(TRUE, 3)), SMALL, (), PITCH, POLICY)
    assert (found.outcome, found.lines) == ("nothing", {})
    assert found.sentence == "The paint of this picture cannot be solved."


def test_cameras_of_other_frames_are_what_is_tried_first(monkeypatch: pytest.MonkeyPatch) -> None:
    tried: list[object] = []

    def keep(_image: object, _pitch: object, known: object, _policy: object) -> None:
        tried.append(known)
        raise GeometryError("that was all")

    monkeypatch.setattr(view_proposal, "propose", keep)
    proposal_of(lawn(drawn(TRUE, 3)), SMALL, (TRUE,), PITCH, POLICY)
    assert tried == [(TRUE,)]


def test_an_empty_lawn_gets_none_and_a_sentence() -> None:
    found = proposal_of(lawn(np.zeros((540, 960), np.bool_)), SMALL, (), PITCH, POLICY)
    assert (found.outcome, found.lines) == ("nothing", {})
    assert found.sentence.endswith(".") and found.sentence[0].isupper()


def test_a_single_line_is_unsure() -> None:
    mask = np.zeros((540, 960), np.uint8)
    cv2.line(mask, (100, 300), (800, 350), 1, 3)
    found = proposal_of(lawn(mask.astype(np.bool_)), SMALL, (), PITCH, POLICY)
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

    monkeypatch.setattr(view_proposal, "propose", keep)
    proposal_of(lawn(drawn(TRUE, 3)), SMALL, (), PITCH, replace(POLICY, goal=goal))
    assert tried == [sought]
