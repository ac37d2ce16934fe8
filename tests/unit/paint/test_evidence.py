"""Evidence: paint along projected markings, to a fraction of a pixel."""

from __future__ import annotations

import numpy as np
import pytest

from app.paint.evidence import (
    find_paint,
    has_grass_beside,
    prepare_picture,
    to_paint_evidence,
    trace_visible_markings,
)
from app.paint.profile_kernels import find_stripes
from app.paint.tracing import TracedPlaces, which_markings_are_painted
from app.soccer.frames import Box
from app.soccer.pitch import MARKINGS, Pitch
from tests.unit.paint.test_grass import GRASS, picture

COUNT = 40


def striped(middle: float, width: float, left: int = 60, right: int = 60) -> np.ndarray:
    """Grass with a vertical stripe, seen through a lens that blurs by 0.6 pixels."""
    fine = np.arange(-0.5, 199.5, 0.05) + 0.025
    paint = np.where(np.abs(fine - middle) < width / 2, 220.0, np.where(fine < middle, left, right))
    lens = np.exp(-0.5 * (np.arange(-60, 61) * 0.05 / 0.6) ** 2)
    seen = np.convolve(np.pad(paint, 60, "edge"), lens / lens.sum(), "valid").reshape(200, 20)
    levels = seen.mean(axis=1)
    image = np.empty((100, 200, 3))
    image[:] = levels[:, None]
    image[:, :, 1] += np.where(np.abs(np.arange(200) - middle) > width / 2 + 0.3, 60, 0)
    return np.clip(np.round(image), 0, 255).astype(np.uint8)


def offsets(image: np.ndarray, expected: float, width: float, window: float = 6.0) -> np.ndarray:
    reading = prepare_picture(image, np.ones(image.shape[:2], np.bool_))
    pixels = np.column_stack([np.full(COUNT, expected), np.linspace(20, 80, COUNT)])
    normals = np.tile([1.0, 0.0], (COUNT, 1))
    found, sigmas, strengths = np.empty(COUNT), np.empty(COUNT), np.empty(COUNT)
    find_stripes(
        reading.level, reading.image, reading.hidden, pixels, normals, np.full(COUNT, width),
        np.full(COUNT, window), reading.noise, 6.0, found, sigmas, strengths,
    )  # fmt: skip
    return found


class TestFindStripes:
    @pytest.mark.parametrize("width", [0.5, 1.0, 2.0, 5.0, 14.0])
    @pytest.mark.parametrize("middle", [100.0, 100.3, 99.55])
    def test_the_middle_is_found_to_a_twelfth_of_a_pixel_at_any_width(self, width, middle):
        assert np.abs(offsets(striped(middle, width), 98.0, width) + 98.0 - middle).max() < 0.08

    def test_grass_that_is_brighter_on_one_side_moves_it_little(self):
        found = offsets(striped(100.2, 2.0, left=60, right=85), 100.0, 2.0)
        assert np.abs(found - 0.2).max() < 0.1

    def test_a_stripe_beyond_the_window_is_not_found(self):
        assert np.isnan(offsets(striped(110.0, 2.0), 100.0, 2.0)).all()

    def test_what_is_broader_than_paint_is_there_is_none(self):
        assert np.isnan(offsets(striped(100.0, 5.0), 100.0, 0.3)).all()

    def test_white_without_grass_beside_it_is_no_paint(self):
        image = striped(100.0, 2.0)
        image[:, 103:] = (90, 90, 90)
        assert np.isnan(offsets(image, 100.0, 2.0)).all()


class TestTrace:
    def test_places_lie_on_the_markings_and_derivatives_match_differences(self, rendered):
        reading = prepare_picture(rendered.image, rendered.field)
        traced = trace_visible_markings(reading, rendered.truth, Pitch())
        assert len(traced.pixels) > 300
        assert which_markings_are_painted()[traced.marking].all()
        apart = np.hypot(*(rendered.truth.project(traced.places) - traced.pixels).T)
        # The lens of the truth has one term, that of the trace a second one tied to it.
        assert np.percentile(apart, 95) < 0.4

    def test_the_jacobian_meets_its_finite_difference(self, rendered):
        from app.geometry.resection import camera_from_parameters, parameters_from_camera

        reading = prepare_picture(rendered.image, rendered.field)
        truth, half = rendered.truth, reading.half_diagonal
        traced = trace_visible_markings(reading, truth, Pitch())
        base = parameters_from_camera(truth, half)
        for index in range(8):
            step = np.zeros(8)
            step[index] = 1e-5
            ends = [
                camera_from_parameters(base + sign * step, truth.principal_point, half)
                for sign in (1, -1)
            ]
            moved = (ends[0].project(traced.places) - ends[1].project(traced.places)) / 2e-5
            expected = (moved * traced.normals).sum(axis=1)
            assert traced.jacobian[:, index] == pytest.approx(
                expected, rel=1e-3, abs=1e-3 * np.abs(expected).max()
            )


class TestShowsGrassBeside:
    def test_nothing_is_asked_beside_a_person_or_along_the_border(self):
        image = np.full((100, 200, 3), GRASS, np.uint8)
        image[:, 120:140] = (180, 30, 30)
        reading = prepare_picture(image, np.ones(image.shape[:2], np.bool_))
        x = np.array([3.0, 60.0, 116.0, 130.0, 160.0, 195.0])
        none = np.zeros((len(x), 3))
        traced = TracedPlaces(
            none, np.column_stack([x, np.full(len(x), 50.0)]), np.tile([1.0, 0.0], (len(x), 1)),
            np.ones(len(x)), np.zeros(len(x), np.int64), none, len(x),
        )  # fmt: skip
        told = has_grass_beside(reading, traced, 3.0)
        assert told.tolist() == [False, True, True, False, True, False]


class TestSeek:
    def test_paint_of_the_true_camera_lies_within_its_sigmas(self, rendered):
        reading = prepare_picture(rendered.image, rendered.field)
        found = find_paint(reading, trace_visible_markings(reading, rendered.truth, Pitch()), 3.0)
        assert found.painted_fraction > 0.5
        assert 0.5 < np.median(np.abs(found.offsets / found.sigmas)) / 0.6745 < 1.6

    def test_nothing_is_believed_in_a_hidden_box(self, rendered):
        box = Box(400.0, 300.0, 500.0, 300.0)
        reading = prepare_picture(rendered.image, rendered.field, [box])
        x, y = find_paint(
            reading, trace_visible_markings(reading, rendered.truth, Pitch()), 3.0
        ).pixels.T
        assert not ((x > 401) & (x < 899) & (y > 301) & (y < 599)).any()

    def test_grass_alone_gives_no_evidence(self, rendered):
        image = picture(GRASS, 720, 1280)
        reading = prepare_picture(image, np.ones((720, 1280), np.bool_))
        assert (
            len(
                find_paint(
                    reading, trace_visible_markings(reading, rendered.truth, Pitch()), 5.0
                ).offsets
            )
            == 0
        )


class TestToPaintEvidence:
    def test_every_place_is_kept_under_its_marking(self, rendered):
        reading = prepare_picture(rendered.image, rendered.field)
        found = find_paint(reading, trace_visible_markings(reading, rendered.truth, Pitch()), 3.0)
        kept = to_paint_evidence(found)
        assert kept.count == len(found.offsets)
        assert set(kept.points) == {MARKINGS[i] for i in np.unique(found.traced.marking)}
