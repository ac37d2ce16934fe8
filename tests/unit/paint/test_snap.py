"""Snap: the camera goes onto the paint, or stays with a reason."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from app.geometry.camera import Camera, rotation_from_pan_tilt_roll
from app.geometry.resection import parameters_from_camera
from app.paint.evidence import DetectedPaint, to_paint_evidence
from app.paint.snap import CURVED, _has_enough_paint, snap_camera
from app.paint.tracing import TracedPlaces
from app.soccer.frames import ImageSize
from app.soccer.group import Station
from app.soccer.paint_evidence import NO_PAINT, PAINT_DISAGREES, PaintReading
from app.soccer.pitch import MARKINGS, Pitch
from app.soccer.policy import CalibrationPolicy
from app.solving.calibrate import calibrate_from_paint
from tests.unit.paint.test_grass import GRASS, picture


def panned(camera: Camera, px: float) -> Camera:
    pan, tilt, roll = np.radians(camera.pan_tilt_roll_degrees)
    turned = rotation_from_pan_tilt_roll(pan + px / camera.focal_length[0], tilt, roll)
    return replace(camera, rotation=turned)


def field_error(camera: Camera, truth: Camera) -> float:
    x, y = np.meshgrid(np.arange(-52.0, 53, 4), np.arange(-34.0, 35, 4))
    points = np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)])
    true = truth.project(points)
    seen = (true[:, 0] > 0) & (true[:, 0] < 1279) & (true[:, 1] > 0) & (true[:, 1] < 719)
    return float(np.median(np.hypot(*(camera.project(points) - true)[seen].T)))


class TestSnap:
    def test_clicks_become_four_times_better_and_their_truth_stays_inside_the_covariance(
        self, rendered
    ):
        camera = rendered.clicked.camera
        known = np.reshape(rendered.clicked.covariance, (8, 8))
        found = snap_camera(rendered.image, rendered.field, camera, start_covariance=known)
        assert found.reason is None
        before, after = (field_error(one, rendered.truth) for one in (camera, found.camera))
        assert after < 0.12 and after < before / 2
        off = found.camera.position - rendered.truth.position
        assert off @ np.linalg.solve(found.planned[3:6, 3:6], off) < 16.3
        assert found.planned.trace() < min(known.trace(), found.covariance.trace())

    def test_eight_pixels_off_it_comes_back(self, rendered):
        found = snap_camera(rendered.image, rendered.field, panned(rendered.truth, 8.0))
        assert found.reason is None
        assert field_error(found.camera, rendered.truth) < 0.12
        assert found.moved_px == pytest.approx(8.0, abs=1.0)

    @pytest.mark.parametrize(("px", "reason"), [(60.0, PAINT_DISAGREES), (120.0, NO_PAINT)])
    def test_too_far_off_it_stays_where_it_was_and_says_why(self, rendered, px, reason):
        start = panned(rendered.truth, px)
        found = snap_camera(rendered.image, rendered.field, start)
        assert found.reason == reason
        assert found.camera is start and found.covariance is None

    def test_a_start_that_is_surely_elsewhere_is_not_overruled(self, rendered):
        start = panned(rendered.truth, 6.0)
        sure = np.diag(np.array([1e-5, 1e-5, 1e-5, 0.01, 0.01, 0.01, 1e-4, 1e-3]) ** 2)
        found = snap_camera(rendered.image, rendered.field, start, start_covariance=sure)
        assert found.reason is not None and found.camera is start

    def test_without_paint_the_start_stays(self, rendered):
        image = picture(GRASS, 720, 1280)
        found = snap_camera(image, np.ones((720, 1280), np.bool_), rendered.truth)
        assert found.reason == NO_PAINT and found.error_px is None

    def test_the_same_picture_gives_the_same_bits(self, rendered):
        start = panned(rendered.truth, 3.0)
        first, second = (snap_camera(rendered.image, rendered.field, start) for _ in range(2))
        assert first.camera == second.camera


class TestCircle:
    @pytest.mark.parametrize(("places", "spacing"), [(60, 4.0), (30, 8.0)])
    def test_suffices_beside_one_line_from_a_certain_length_on_whatever_the_spacing(
        self, places, spacing
    ):
        def suffices(on_circle: int) -> bool:
            marking = np.repeat(
                np.array([CURVED[0], MARKINGS.index("Middle line")]), (on_circle, 10)
            )
            none = np.zeros((len(marking), 2))
            traced = TracedPlaces(none, none, none, none[:, 0], marking, none, len(marking))
            seen = DetectedPaint(traced, none[:, 0], none[:, 0], none[:, 0])
            return _has_enough_paint(seen, CURVED, spacing)

        assert suffices(places) and not suffices(places - 1)


class TestStored:
    def test_solving_with_what_is_kept_gives_the_camera_that_the_picture_gave(self, rendered):
        clicked = rendered.clicked
        known = np.reshape(clicked.covariance, (8, 8))
        found = snap_camera(rendered.image, rendered.field, clicked.camera, start_covariance=known)
        kept = to_paint_evidence(found.evidence, found.camera)
        size = ImageSize(1280, 720)
        station = Station("main", size)
        reading = PaintReading("", "", kept)
        again = calibrate_from_paint(clicked, reading, station, Pitch(), CalibrationPolicy())
        assert again.source == "paint"
        moved = parameters_from_camera(again.camera, size.diagonal / 2) - parameters_from_camera(
            found.camera, size.diagonal / 2
        )
        sigma = np.sqrt(np.diag(found.planned))
        assert np.abs(moved / sigma).max() < 0.1
        told = np.sqrt(np.diag(np.reshape(again.covariance, (8, 8))))
        assert told == pytest.approx(sigma, rel=0.02)
        whole = np.sqrt(np.diag(np.reshape(again.known_covariance_with_pitch, (8, 8))))
        assert whole == pytest.approx(np.sqrt(np.diag(found.covariance)), rel=0.02)
        assert (whole[3:6] > 2 * told[3:6]).any()
