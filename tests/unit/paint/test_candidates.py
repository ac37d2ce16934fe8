from __future__ import annotations

import numpy as np
import pytest

from app.geometry.camera import Camera
from app.geometry.resection import KAPPA, PAN, TILT, camera_from_parameters, parameters_from_camera
from app.paint.candidates import (
    KNOWN,
    MAIN,
    WIDE,
    CameraSearchSpace,
    find_candidate_cameras,
    make_search_space_of_known_cameras,
)
from app.soccer.pitch import Segment
from tests.unit.paint.lawns import PITCH, SMALL, TRUE

FOCAL = TRUE.focal_length[0]
EXACT = CameraSearchSpace(
    "exact",
    # A copy, as the product's: for an array that is only read all would be compiled once more.
    np.array([TRUE.position]),
    (FOCAL / SMALL.width, FOCAL / SMALL.width),
    np.ones(3),
)


def _piece(camera: Camera, marking: str, first: float, last: float) -> np.ndarray:
    """A part of a marking in the picture, relative to the principal point, shape (1, 4)."""
    shape = PITCH.shapes[marking]
    assert isinstance(shape, Segment)
    start, end = np.array(shape.start), np.array(shape.end)
    pixels = camera.project(start + np.array([[first], [last]]) * (end - start))
    return (pixels - camera.principal_point).reshape(1, 4)


class TestCandidates:
    @pytest.mark.parametrize(
        "marking", ["Big rect. right main", "Side line right", "Side line top"]
    )
    def test_the_true_camera_is_among_them_where_one_marking_is_seen(self, marking: str):
        rows = find_candidate_cameras(_piece(TRUE, marking, 0.3, 0.7), EXACT, PITCH, SMALL.width)
        true = parameters_from_camera(TRUE, SMALL.diagonal / 2)
        apart = np.abs(rows[:, PAN : TILT + 1] - true[PAN : TILT + 1]).max(axis=1)
        assert np.degrees(apart.min()) < 0.01

    def test_each_of_them_sees_a_marking_along_the_piece(self):
        piece = _piece(TRUE, "Big rect. right top", 0.1, 0.9)
        rows = find_candidate_cameras(piece, MAIN, PITCH, SMALL.width)
        assert 50 < len(rows) < 3000
        assert (np.degrees(rows[:, TILT]) < 91).all()

    def test_none_lays_a_short_marking_on_a_piece_that_is_longer(self):
        whole = _piece(TRUE, "Side line right", 0.0, 0.9)
        rows = find_candidate_cameras(whole, EXACT, PITCH, SMALL.width)
        assert 1 <= len(rows) < 6

    def test_every_stand_is_beside_the_pitch_on_the_side_of_the_main_camera(self):
        for library in (MAIN, WIDE):
            x, y, z = library.stands.T
            assert (y >= 0).all()
            assert (z < 0).all()
            assert ((np.abs(x) > PITCH.length / 2) | (y > PITCH.width / 2)).all()


class TestKnownLibrary:
    def test_it_has_each_stand_once_and_the_lens_of_its_cameras(self):
        half = SMALL.diagonal / 2
        bent = parameters_from_camera(TRUE, half)
        bent[KAPPA] = 0.08
        near = camera_from_parameters(bent, TRUE.principal_point, half)
        found = make_search_space_of_known_cameras([near, near.scaled(2.0, 2.0)])
        assert found.name == KNOWN
        assert found.stands.tolist() == [pytest.approx(TRUE.position.tolist())]
        low, high = found.focal_range
        assert low < FOCAL / SMALL.width < high < 6.0
        assert high / low < 10
        assert found.kappa == pytest.approx(0.08, abs=1e-3)
