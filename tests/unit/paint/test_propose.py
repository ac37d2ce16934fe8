from __future__ import annotations

import cv2
import numpy as np
import numpy.typing as npt
import pytest

from app.paint.candidates import Library
from app.paint.propose import propose
from app.sample.render import render
from app.sample.scene import Scene
from app.sample.scenes import make_match
from app.soccer.annotation import make_lines
from app.soccer.frames import ImageSize
from app.solving.jaccard import camera_jaccard, project_markings
from tests.unit.paint.lawns import PITCH, SMALL, TRUE, drawn, lawn

Image = npt.NDArray[np.uint8]


@pytest.fixture(scope="module")
def scene() -> Scene:
    return make_match(0, 2, 20_260_101, faults=False, numbers=[0])[0]


@pytest.fixture(scope="module")
def frame(scene: Scene) -> Image:
    return np.ascontiguousarray(render(scene, scene.group.views[0].key)[:, :, ::-1])


class TestPropose:
    def test_a_rendered_frame_gets_its_camera(self, scene: Scene, frame: Image):
        true = scene.truth.views[0].camera
        size = ImageSize(frame.shape[1], frame.shape[0])
        found = propose(frame)
        assert (found.outcome, found.reason) == ("proposed", None)
        assert found.camera is not None
        seen = make_lines(
            {name: p[::5].tolist() for name, p in project_markings(true, PITCH, size).items()}
        )
        assert camera_jaccard(found.camera, seen, PITCH, size, (0.005 * size.diagonal,))[0] > 0.75

    def test_what_the_match_knows_is_enough(
        self, scene: Scene, frame: Image, monkeypatch: pytest.MonkeyPatch
    ):
        nowhere = Library("nowhere", np.array([[0.0, 500.0, -5.0]]), (1.0, 1.0), np.ones(3))
        monkeypatch.setattr("app.paint.propose.MAIN", nowhere)
        monkeypatch.setattr("app.paint.propose.WIDE", nowhere)
        true = scene.truth.views[0].camera
        assert propose(frame).outcome == "unsure"
        found = propose(frame, known=[true])
        assert found.outcome == "proposed"
        assert found.camera is not None
        assert np.linalg.norm(found.camera.position - true.position) < 2.0

    def test_a_camera_stands_where_y_is_positive(self):
        found = propose(lawn(drawn(TRUE, 3)))
        assert found.outcome == "proposed"
        assert found.camera is not None
        assert found.camera.position[1] > 0

    @pytest.mark.parametrize(
        ("picture", "reason"),
        [
            (lawn(np.zeros((540, 960), np.bool_)), "no straight line"),
            (np.zeros((540, 960, 3), np.uint8), "no colours"),
            (np.full((540, 960, 3), 240, np.uint8), "white"),
            (lawn(drawn(TRUE, 3))[:100, :100], "too small"),
        ],
        ids=["grass alone", "night", "snow", "tiny"],
    )
    def test_a_picture_without_lines_gets_nothing_and_a_reason(self, picture: Image, reason: str):
        found = propose(picture)
        assert found.outcome == "nothing"
        assert found.camera is None
        assert reason in (found.reason or "")

    def test_lines_of_another_sport_are_no_pitch(self):
        mask = np.zeros((SMALL.height, SMALL.width), np.uint8)
        for x in range(100, 900, 90):
            cv2.line(mask, (x, 60), (x - 80, 500), 1, 3)
        found = propose(lawn(mask.astype(np.bool_)))
        assert found.outcome == "unsure"
        assert found.reason
