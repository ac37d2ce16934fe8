"""Evidence: the limits from which on paint counts, and the pixels that it is told in."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from app.geometry.camera import Camera
from app.paint.evidence import (
    MOST_PLACES,
    SPACING_PX,
    DetectedPaint,
    PreparedPicture,
    _is_bright_as_paint,
    exclude_hidden_boxes,
    find_paint,
    has_grass_beside,
    prepare_picture,
    to_paint_evidence,
    trace_visible_markings,
)
from app.paint.profile_kernels import find_stripes
from app.paint.tracing import TracedPlaces, trace_places
from app.soccer.frames import Box, ImageSize
from app.soccer.pitch import MARKINGS, Pitch
from tests.cameras import looking
from tests.unit.paint.test_evidence import striped
from tests.unit.paint.test_grass import CROWD, GRASS, picture
from tests.unit.paint.test_snap import panned

WHITE = (230, 230, 230)
HEIGHT, WIDTH = 100, 200


def read(image: np.ndarray) -> PreparedPicture:
    return prepare_picture(image, np.ones(image.shape[:2], np.bool_))


def upright(x: object, width: float = 5.0, marking: object = 0) -> TracedPlaces:
    """Places down the middle of a picture, expected at these columns."""
    columns = np.asarray(x, np.float64)
    count = len(columns)
    pixels = np.column_stack([columns, np.linspace(20, HEIGHT - 20, count)])
    return TracedPlaces(
        np.zeros((count, 3)), pixels, np.tile([1.0, 0.0], (count, 1)), np.full(count, width),
        np.broadcast_to(np.asarray(marking, np.int64), count), np.zeros((count, 8)), count,
    )  # fmt: skip


def stripe(colour: tuple[int, int, int], left: int = 98, right: int = 103) -> np.ndarray:
    """Plain grass with a vertical stripe of these columns."""
    image = picture(GRASS, HEIGHT, WIDTH)
    image[:, left:right] = colour
    return image


def brighter_by(levels: int) -> tuple[int, int, int]:
    return tuple(channel + levels for channel in GRASS)


def noisy(image: np.ndarray, sigma: float, seed: int = 4) -> np.ndarray:
    spread = np.random.default_rng(seed).normal(0, sigma, image.shape)
    return np.clip(np.round(image + spread), 0, 255).astype(np.uint8)


class TestReadPicture:
    @pytest.mark.parametrize("sigma", [4.0, 12.0])
    def test_noise_is_the_deviation_of_the_grass_alone(self, sigma: float) -> None:
        image = noisy(picture(GRASS, HEIGHT, WIDTH), sigma)
        field = np.zeros((HEIGHT, WIDTH), np.bool_)
        field[:, 80:] = True
        image[:, :80] = noisy(picture(CROWD, HEIGHT, 80), 60.0)
        reading = prepare_picture(image, field)
        assert reading.noise == pytest.approx(float(reading.level[:, 84:].std()), rel=0.15)

    def test_a_drawn_picture_has_half_a_grey_level_of_noise(self) -> None:
        assert read(picture(GRASS, HEIGHT, WIDTH)).noise == 0.5

    def test_brightness_is_smoothed_by_seven_tenths_of_a_pixel(self) -> None:
        image = picture((0, 0, 0), HEIGHT, WIDTH)
        image[50, 100] = 255
        share = read(image).level.sum(axis=0) / 255
        assert share.sum() == pytest.approx(1, abs=1e-3)
        assert np.sqrt(share @ (np.arange(WIDTH) - 100.0) ** 2) == pytest.approx(0.7, abs=0.03)


class TestSeenField:
    @pytest.mark.parametrize(
        ("box", "rows", "columns"),
        [
            (Box(10.4, 20.6, 5.2, 3.0), range(20, 24), range(10, 16)),
            (Box(10.0, 20.0, 5.0, 3.0), range(20, 23), range(10, 15)),
            (Box(-5.0, -6.0, 10.0, 8.0), range(2), range(5)),
            (Box(195.5, 97.5, 50.0, 50.0), range(97, 100), range(195, 200)),
            (Box(-30.0, 20.0, 10.0, 10.0), range(0), range(0)),
            (Box(20.0, -30.0, 10.0, 10.0), range(0), range(0)),
        ],
    )
    def test_a_box_hides_every_pixel_that_it_touches_and_no_other(
        self, box: Box, rows: range, columns: range
    ) -> None:
        expected = np.ones((HEIGHT, WIDTH), np.bool_)
        for row in rows:
            expected[row, list(columns)] = False
        seen = exclude_hidden_boxes(np.ones((HEIGHT, WIDTH), np.bool_), [box])
        assert np.array_equal(seen, expected)


class TestTrace:
    @pytest.mark.parametrize(("width", "spacing"), [(960, 4.0), (1920, 4.0), (3840, 8.0)])
    def test_places_lie_four_pixels_apart_and_farther_in_a_broader_picture(
        self, width: int, spacing: float
    ) -> None:
        traced = self.whole_pitch(width)
        apart = np.hypot(*np.diff(traced.pixels, axis=0).T)[np.diff(traced.marking) == 0]
        assert np.median(apart) == pytest.approx(spacing, rel=0.1)

    @pytest.mark.parametrize("width", [1920, 3840])
    def test_no_marking_is_left_out_of_a_picture_of_the_whole_pitch(self, width: int) -> None:
        traced = self.whole_pitch(width)
        names = {MARKINGS[index] for index in traced.marking}
        assert names == {name for name in MARKINGS if not name.startswith("Goal")}

    def test_thin_paint_and_paint_off_the_field_are_not_sought_and_only_thin_paint_is_missed(
        self,
    ) -> None:
        size = ImageSize(1280, 720)
        camera = looking((0.0, 62.0, -9.0), (0.0, -10.0, 0.0), 700.0)
        # Every second pixel is field, so that it matters which is meant.
        field = np.indices((size.height, size.width)).sum(axis=0) % 2 == 0
        reading = prepare_picture(picture(GRASS, size.height, size.width), field)
        every = trace_places(camera, Pitch(), size.width, size.height, SPACING_PX, MOST_PLACES)
        columns, rows = np.rint(every.pixels).astype(int).T
        on_field = field[rows, columns]
        traced = trace_visible_markings(reading, camera, Pitch())
        assert traced.visible == on_field.sum()
        assert np.array_equal(traced.pixels, every.pixels[on_field & (every.widths >= 0.25)])
        assert 0 < len(traced.pixels) < traced.visible < len(every.pixels)

    @staticmethod
    def whole_pitch(width: int) -> TracedPlaces:
        size = ImageSize(width, width * 9 // 16)
        camera = looking((0.0, 20.0, -105.0), (0.0, 2.0, 0.0), 0.8 * width, size=size)
        return trace_visible_markings(
            read(picture(GRASS, size.height, size.width)), camera, Pitch()
        )


class TestSeek:
    @pytest.mark.parametrize(("levels", "found"), [(4, 0), (9, 16)])
    def test_a_stripe_stands_out_from_six_grey_levels_on(self, levels: int, found: int) -> None:
        evidence = find_paint(read(stripe(brighter_by(levels))), upright([100.0] * 16), 6.0)
        assert len(evidence.offsets) == found

    @pytest.mark.parametrize(("times", "few"), [(2, True), (8, False)])
    def test_in_noise_a_stripe_must_stand_out_by_four_of_its_deviations(
        self, times: int, few: bool
    ) -> None:
        noise = read(noisy(picture(GRASS, HEIGHT, WIDTH), 8.0)).noise
        reading = read(noisy(stripe(brighter_by(round(times * noise))), 8.0))
        assert 2 * reading.noise > 6.0
        share = find_paint(reading, upright([100.0] * 16), 6.0).painted_fraction
        assert share < 0.2 if few else share > 0.8

    @pytest.mark.parametrize(
        ("colour", "paint"),
        [
            (WHITE, True),
            ((GRASS[2], 230, 230), False),
            ((230, GRASS[2], 230), False),
            ((230, 230, GRASS[2]), False),
        ],
    )
    def test_paint_is_bright_in_every_channel(
        self, colour: tuple[int, int, int], paint: bool
    ) -> None:
        evidence = find_paint(read(stripe(colour)), upright([100.0] * 16), 6.0)
        assert len(evidence.offsets) == (16 if paint else 0)

    def test_each_place_is_sought_in_its_own_window(self) -> None:
        windows = np.repeat([2.0, 7.0], 20)
        evidence = find_paint(
            read(stripe(WHITE)), upright([96.0] * 40, marking=windows > 4), windows
        )
        assert evidence.traced.marking.tolist() == [1] * 20
        assert evidence.offsets == pytest.approx(4.0, abs=0.1)

    @pytest.mark.parametrize(
        ("aside", "kept"),
        [(0.08, True), (0.3, True), (0.6, False)],
    )
    def test_half_of_the_places_around_confirm_within_a_pixel(
        self, aside: float, kept: bool
    ) -> None:
        # Each place lies so much farther to the side of the stripe than the one before it.
        columns = 100.0 + aside * np.arange(-10, 11)
        found = find_paint(read(stripe(WHITE)), upright(columns), 8.0).offsets
        assert len(found) > 15 if kept else not len(found)

    @pytest.mark.parametrize(("shown", "kept"), [(0.7, True), (0.3, False)])
    def test_paint_that_is_worn_away_at_most_places_is_none(self, shown: float, kept: bool) -> None:
        count = 60
        rows = np.linspace(20, 380, count)
        image = picture(GRASS, 400, WIDTH)
        # Of ten places that many in a row show paint.
        painted = np.arange(count) % 10 < 10 * shown
        for row in rows[painted]:
            image[round(row) - 3 : round(row) + 4, 98:103] = WHITE
        traced = upright([100.0] * count)
        traced.pixels[:, 1] = rows
        share = find_paint(read(image), traced, 6.0).painted_fraction
        assert share == pytest.approx(shown, abs=0.15) if kept else share < 0.1

    @pytest.mark.parametrize(
        ("alone", "told"), [(0.05, 0.053), (0.1, 0.125), (0.2, 0.4), (0.4, 2.0)]
    )
    def test_noise_that_makes_sigma_a_fifth_of_a_pixel_doubles_it(
        self, alone: float, told: float
    ) -> None:
        reading, traced = read(striped(100.0, 3.0)), upright([100.0] * 16, 3.0)
        # The floor of 0.04 pixels stands beside the noise.
        noise = np.sqrt(alone**2 - 0.04**2) / _sigma_of_one_level(reading, traced)
        sigmas = find_paint(replace(reading, noise=noise), traced, 6.0).sigmas
        assert sigmas == pytest.approx(told, rel=0.01)


class TestBrightAsPaint:
    @pytest.mark.parametrize(
        ("width", "least", "most"),
        [(2.6, 30.0, 208.0), (8.0, 30.0, 208.0), (1.3, 15.0, 108.0), (0.65, 7.5, 58.0)],
    )
    def test_a_stripe_is_about_as_bright_as_paint_of_its_width(
        self, width: float, least: float, most: float
    ) -> None:
        # The paint of the picture: 100 grey levels where it is broad, half of it at 1.3 pixels.
        asked = np.array([least - 1, least + 1, most - 1, most + 1])
        strengths = np.concatenate([[100.0] * 12, [50.0] * 12, asked])
        widths = np.concatenate([[4.0] * 12, [1.3] * 12, [width] * 4])
        told = _is_bright_as_paint(strengths, widths)
        assert told[:24].all() and told[24:].tolist() == [False, True, True, False]


class TestShowsGrassBeside:
    @pytest.mark.parametrize(
        ("x", "width", "window", "shown"),
        [
            # Three pixels beside thin paint, one more, and the window: seven from 2 and from 197.
            (8.5, 1.0, 3.0, False),
            (9.5, 1.0, 3.0, True),
            (189.5, 1.0, 3.0, True),
            (190.5, 1.0, 3.0, False),
            (11.5, 1.0, 6.0, False),
            (12.5, 1.0, 6.0, True),
            # Beside paint of six pixels grass is looked for two and a half beyond its edge.
            (10.5, 6.0, 3.0, False),
            (12.0, 6.0, 3.0, True),
        ],
    )
    def test_paint_is_asked_for_where_it_would_be_found(
        self, x: float, width: float, window: float, shown: bool
    ) -> None:
        traced = upright([x] * 4, width)
        assert has_grass_beside(read(picture(GRASS, HEIGHT, WIDTH)), traced, window).all() == shown
        painted = striped(x, width)
        assert (len(find_paint(read(painted), traced, window).offsets) == 4) == shown

    @pytest.mark.parametrize(
        ("x", "width", "column", "shown"),
        [
            # The middle of a pixel is whole: 60.6 and three beside it are pixels 64 and 58.
            (60.6, 1.0, 64, False),
            (60.6, 1.0, 63, True),
            (60.6, 1.0, 58, False),
            (60.6, 1.0, 57, True),
            (60.0, 6.0, 63, True),
            (60.0, 6.0, 66, False),
        ],
    )
    def test_nothing_is_asked_where_the_grass_beside_it_is_hidden(
        self, x: float, width: float, column: int, shown: bool
    ) -> None:
        image = picture(GRASS, HEIGHT, WIDTH)
        hidden = [Box(column, 0.0, 1.0, HEIGHT)]
        reading = prepare_picture(image, np.ones((HEIGHT, WIDTH), np.bool_), hidden)
        assert has_grass_beside(reading, upright([x] * 4, width), 3.0).all() == shown


class TestEvidence:
    def test_paint_is_told_where_it_lies_and_not_on_the_other_side(self, rendered) -> None:
        start = panned(rendered.truth, 3.0)
        evidence = found_with(rendered, start)
        kept = to_paint_evidence(evidence)
        told = {
            "pixels": [
                (MARKINGS[index], x, y)
                for index, (x, y) in zip(
                    evidence.traced.marking, evidence.pixels.tolist(), strict=True
                )
            ],
            "kept": [(name, x, y) for name, rows in kept.points.items() for x, y, _ in rows],
        }
        curves = {
            name: rendered.truth.project(Pitch().sample(name, 0.02, 0.02)) for name in kept.points
        }
        for places in told.values():
            off = [np.hypot(*(curves[name] - (x, y)).T).min() for name, x, y in places]
            assert len(off) > 100 and np.median(off) < 0.2

    def test_with_its_camera_paint_is_told_beside_the_middle_of_the_marking(self, rendered) -> None:
        # This camera is not quite the one that was sought with: its places are told apart.
        evidence, camera = found_with(rendered, rendered.truth), panned(rendered.truth, 5.0)
        on_it = replace(evidence, offsets=np.zeros(len(evidence.offsets)))
        kept = to_paint_evidence(on_it, camera)
        told = [(x, y) for name in MARKINGS for x, y, _ in kept.points.get(name, ())]
        middle = camera.project(evidence.traced.places)
        assert np.array(told) == pytest.approx(middle, abs=0.5e-4)

    def test_no_place_that_is_kept_is_free_of_error(self, rendered) -> None:
        evidence = found_with(rendered, rendered.truth)
        sure = replace(evidence, sigmas=np.full(len(evidence.sigmas), 1e-6))
        points = to_paint_evidence(sure).points.values()
        assert {place.sigma_px for places in points for place in places} == {1e-4}

    def test_of_a_camera_that_shows_no_marking_no_share_is_seen(self) -> None:
        reading = read(picture(GRASS, 720, 1280))
        up = looking((0.0, 62.0, -9.0), (0.0, 20.0, -60.0), 1500.0)
        evidence = find_paint(reading, trace_visible_markings(reading, up, Pitch()), 3.0)
        assert (evidence.traced.visible, evidence.painted_fraction) == (0, 0.0)

    @pytest.mark.parametrize("factor", [0.5, 3.0])
    def test_resized_it_is_that_of_the_resized_picture(self, rendered, factor: float) -> None:
        evidence = found_with(rendered, rendered.truth)
        larger = evidence.scaled(factor)
        camera, scaled = rendered.truth, rendered.truth.scaled(factor, factor)
        places = evidence.traced.places
        # What the trace lies off its camera by, in pixels, grows with the picture.
        off = evidence.traced.pixels - camera.project(places)
        assert larger.traced.pixels - scaled.project(places) == pytest.approx(
            factor * off, abs=1e-9
        )
        for name in ("widths", "jacobian"):
            expected = factor * getattr(evidence.traced, name)
            assert getattr(larger.traced, name) == pytest.approx(expected)
        assert larger.offsets == pytest.approx(factor * evidence.offsets)
        assert larger.sigmas == pytest.approx(factor * evidence.sigmas)
        assert larger.painted_fraction == evidence.painted_fraction


def found_with(rendered, camera: Camera) -> DetectedPaint:
    reading = prepare_picture(rendered.image, rendered.field)
    return find_paint(reading, trace_visible_markings(reading, camera, Pitch()), 6.0)


def _sigma_of_one_level(reading: PreparedPicture, traced: TracedPlaces) -> float:
    """Standard deviation of a place, pixels, where the noise is one grey level."""
    offsets, sigmas, strengths = np.empty((3, len(traced.pixels)))
    find_stripes(
        reading.level, reading.image, reading.hidden, traced.pixels, traced.normals,
        traced.widths, np.full(len(offsets), 6.0), 1.0, 6.0, offsets, sigmas, strengths,
    )  # fmt: skip
    return float(np.median(sigmas))
