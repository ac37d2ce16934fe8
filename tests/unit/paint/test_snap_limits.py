"""Snap: how far paint is sought, from which on it is enough, and when it disagrees."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import cv2
import numpy as np
import pytest

from app.geometry.camera import Camera, rotation_from_pan_tilt_roll
from app.paint.evidence import (
    DetectedPaint,
    PreparedPicture,
    prepare_picture,
    trace_visible_markings,
)
from app.paint.snap import SnappedCamera, _has_enough_paint, snap_camera
from app.paint.tracing import PAINTED, TracedPlaces
from app.soccer.frames import ImageSize
from app.soccer.paint_evidence import NO_PAINT, PAINT_DISAGREES
from app.soccer.pitch import MARKINGS, Pitch
from app.soccer.policy import CalibrationPolicy
from app.solving.jaccard import project_markings
from tests.cameras import looking
from tests.unit.paint.test_snap import panned

FINE = 8
"""Parts of a pixel that paint is drawn in."""
LEVEL = (
    "Side line top",
    "Big rect. right top",
    "Big rect. right bottom",
    "Small rect. right top",
    "Small rect. right bottom",
)
"""Markings that lie along the rows of the picture: a tilt moves them across."""


def camera_of(width: int) -> Camera:
    """A main camera that looks straight across at the right penalty area."""
    size = ImageSize(width, width * 9 // 16)
    return looking((30.0, 62.0, -16.0), (36.0, -4.0, 0.0), 1500.0 * width / 960, size=size)


def tilted(camera: Camera, px: float) -> Camera:
    pan, tilt, roll = np.radians(camera.pan_tilt_roll_degrees)
    turned = rotation_from_pan_tilt_roll(pan, tilt + px / camera.focal_length[0], roll)
    return replace(camera, rotation=turned)


def drawn(
    camera: Camera,
    names: Sequence[str] = PAINTED,
    *,
    pitch: Pitch | None = None,
    over: np.ndarray | None = None,
    white: float = 225.0,
) -> np.ndarray:
    """Paint on grass, as broad as 0.12 m are there; ``over`` a picture that has some."""
    width = round(2 * camera.principal_point[0] + 1)
    size = ImageSize(width, width * 9 // 16)
    grass = np.full((size.height, size.width, 3), (48.0, 120.0, 50.0))
    image = grass if over is None else over
    traced = trace_visible_markings(read(grass.astype(np.uint8)), camera, Pitch())
    for name, line in project_markings(camera, pitch or Pitch(), size).items():
        broad = traced.widths[traced.marking == MARKINGS.index(name)]
        if name not in names or not len(broad):
            continue
        mask = np.zeros((size.height * FINE, size.width * FINE), np.uint8)
        places = np.round((line + 0.5) * FINE - 0.5).astype(np.int32)
        cv2.polylines(mask, [places], False, 255, round(float(np.median(broad)) * FINE))
        cover = cv2.resize(mask, (size.width, size.height), interpolation=cv2.INTER_AREA)
        share = cover[:, :, None] / 255
        image = image * (1 - share) + share * np.array([white, white + 5, white])
    return image


def photographed(image: np.ndarray) -> np.ndarray:
    noise = np.random.default_rng(1).normal(0, 2, image.shape)
    return np.clip(np.round(cv2.GaussianBlur(image, (0, 0), 0.6) + noise), 0, 255).astype(np.uint8)


def read(image: np.ndarray) -> PreparedPicture:
    return prepare_picture(image, np.ones(image.shape[:2], np.bool_))


def known(camera: Camera, *, pan_px: float = 1e-5, tilt_px: float = 1e-5) -> np.ndarray:
    """Covariance of a start of which all is known but that much."""
    focal = camera.focal_length[0]
    sigma = [pan_px / focal, tilt_px / focal, 1e-8, 1e-5, 1e-5, 1e-5, 1e-8, 1e-7]
    return np.diag(np.square(sigma))


def snapped(image: np.ndarray, start: Camera, **told: object) -> SnappedCamera:
    return snap_camera(image, np.ones(image.shape[:2], np.bool_), start, **told)


@pytest.fixture(scope="module")
def level() -> dict[int, np.ndarray]:
    """Pictures of the level markings, by width."""
    return {width: photographed(drawn(camera_of(width), LEVEL)) for width in (960, 1280)}


@pytest.fixture(scope="module")
def whole() -> np.ndarray:
    """A picture of all markings, 960 pixels wide."""
    return photographed(drawn(camera_of(960)))


class TestEnough:
    @pytest.mark.parametrize(
        ("counts", "enough"),
        [
            ((8, 8, 8), True),
            ((8, 8, 7), False),
            ((4, 4, 16), True),
            ((3, 4, 17), False),
            ((3, 3, 40), False),
            ((20, 20), False),
            ((6, 6, 6, 6), True),
            ((7, 7, 7, 1, 1, 1), True),
            ((3, 3, 3, 3, 3, 3, 3, 3), False),
        ],
    )
    def test_24_places_and_three_markings_with_four_of_them_determine_a_camera(
        self, counts: tuple[int, ...], enough: bool
    ) -> None:
        marking = np.repeat(np.arange(len(counts)), counts)
        none = np.zeros((len(marking), 2))
        traced = TracedPlaces(none, none, none, none[:, 0], marking, none, 10 * len(marking))
        seen = DetectedPaint(traced, none[:, 0], none[:, 0], none[:, 0])
        assert _has_enough_paint(seen, []) == enough

    @pytest.mark.parametrize(
        ("names", "reason"),
        [
            # 24 % and 19 % of the visible places of markings.
            (("Circle right", "Big rect. right main", "Small rect. right bottom"), None),
            (("Circle right", "Small rect. right main", "Small rect. right bottom"), NO_PAINT),
        ],
    )
    def test_where_less_than_a_fifth_of_what_should_be_seen_shows_paint_there_is_none(
        self, names: tuple[str, ...], reason: str | None
    ) -> None:
        image, start = photographed(drawn(camera_of(960), names)), panned(camera_of(960), 1.0)
        found = snapped(image, start)
        assert found.reason == reason
        assert found.point_count == len(found.evidence.pixels) > 100
        assert (found.evidence.painted_fraction < 0.2) == (reason == NO_PAINT)

    def test_eighty_places_in_a_corner_of_the_field_determine_a_camera(self, whole) -> None:
        x, y = np.meshgrid(np.arange(960), np.arange(540))
        found = snap_camera(whole, np.hypot(x - 720, y - 270) < 80, panned(camera_of(960), 1.0))
        assert found.reason is None and found.point_count < 90


class TestReach:
    @pytest.mark.parametrize(("px", "reason"), [(13.0, None), (14.0, PAINT_DISAGREES)])
    def test_a_start_from_nowhere_is_moved_by_the_first_window_at_most(
        self, rendered, px: float, reason: str | None
    ) -> None:
        # Ten pixels at 960 x 540 are 13.3 of this picture.
        found = snap_camera(rendered.image, rendered.field, panned(rendered.truth, px))
        assert found.reason == reason
        # What snapping did, or would have done.
        assert found.moved_px == pytest.approx(px, abs=0.3)
        assert found.error_px is not None and found.error_px < 0.1

    def test_a_start_that_is_known_badly_may_move_farther(self, level) -> None:
        camera = camera_of(960)
        spread = known(camera, pan_px=6.0)
        found = snapped(level[960], panned(camera, 14.0), start_covariance=spread)
        assert found.reason is None and found.moved_px > 13.0

    @pytest.mark.parametrize(
        ("width", "tilt_px", "px", "reason"),
        [
            # Four of its sigmas, and two pixels at 960 x 540.
            (960, 1.0, 5.5, None),
            (960, 1.0, -5.5, None),
            (960, 1.0, 7.4, NO_PAINT),
            (960, 0.5, 3.5, None),
            (960, 0.5, 4.7, NO_PAINT),
            (960, 1e-5, 1.8, PAINT_DISAGREES),
            (960, 1e-5, 2.3, NO_PAINT),
            (1280, 1e-5, 2.3, PAINT_DISAGREES),
            (1280, 1e-5, 2.9, NO_PAINT),
        ],
    )
    def test_paint_is_sought_no_farther_off_than_a_known_start_allows(
        self, level, width: int, tilt_px: float, px: float, reason: str | None
    ) -> None:
        camera = camera_of(width)
        spread = known(camera, tilt_px=tilt_px)
        found = snapped(level[width], tilted(camera, px), start_covariance=spread)
        assert found.reason == reason

    @pytest.mark.parametrize(
        ("width", "px", "counted"),
        [(960, 2.4, True), (960, 4.1, False), (1280, 3.4, True), (1280, 5.5, False)],
    )
    def test_in_the_end_paint_counts_within_three_pixels_of_its_marking(
        self, width: int, px: float, counted: bool
    ) -> None:
        # Three pixels at 960 x 540, four at 1280 x 720; one line was painted so far aside.
        name, camera = "Small rect. right main", camera_of(width)
        others = drawn(camera, [one for one in PAINTED if one != name])
        begin, *_, end = project_markings(camera, Pitch(), ImageSize(width, width * 9 // 16))[name]
        along = (end - begin) / np.hypot(*(end - begin))
        image = photographed(drawn(panned(camera, px / abs(along[1])), [name], over=others))
        found = snapped(image, camera)
        assert found.reason is None
        of_it = found.evidence.traced.marking == MARKINGS.index(name)
        assert (of_it.sum() > 20) == counted and (counted or not of_it.any())


class TestDisagreement:
    @pytest.mark.parametrize(
        ("width", "px", "reason"),
        [
            (960, 0.5, None),
            (960, 0.7, PAINT_DISAGREES),
            (960, -0.7, PAINT_DISAGREES),
            (1280, 0.7, None),
            (1280, -0.7, None),
            (1280, 0.9, PAINT_DISAGREES),
            (1280, -0.9, PAINT_DISAGREES),
        ],
    )
    def test_paint_lies_on_its_markings_within_six_tenths_of_a_pixel(
        self, level, width: int, px: float, reason: str | None
    ) -> None:
        # At 960 x 540; a start of which all is known is held beside the paint.
        start = tilted(camera_of(width), px)
        found = snapped(level[width], start, start_covariance=known(start))
        assert found.reason == reason
        assert found.error_px == pytest.approx(abs(px), abs=0.03)
        assert found.moved_px < 0.01

    def test_bright_lines_of_another_sport_are_not_followed_away_from_more_paint(self) -> None:
        camera = camera_of(960)
        others = [name for name in PAINTED if not name.startswith("Side line")]
        worn = drawn(camera, white=110.0)
        image = photographed(drawn(tilted(camera, 5.0), others, over=worn))
        found = snapped(image, camera)
        assert found.reason == PAINT_DISAGREES and found.camera is camera
        # They were followed: on them the camera would lie as well as on its own.
        assert found.moved_px == pytest.approx(5.0, abs=0.3)
        assert found.error_px is not None and found.error_px < 0.1

    def test_the_move_is_that_of_half_of_the_places(self, whole) -> None:
        # A lens that is too long moves places the more the farther from the middle they lie.
        camera = camera_of(960)
        start = replace(camera, focal_length=(1515.0, 1515.0))
        found = snapped(whole, start)
        assert found.reason is None
        places = found.evidence.traced.places
        moves = np.hypot(*(camera.project(places) - start.project(places)).T)
        assert np.ptp(moves) > 4.0
        assert np.mean(moves < found.moved_px) == pytest.approx(0.5, abs=0.05)


class TestWhatIsKnown:
    def test_paint_of_a_smaller_pitch_is_sought_on_that_pitch(self) -> None:
        camera, small = camera_of(960), Pitch(100.0, 64.0)
        image = photographed(drawn(camera, pitch=small))
        found = snapped(image, panned(camera, 2.0), pitch=small)
        assert found.reason is None
        assert np.linalg.norm(found.camera.position - camera.position) < 0.5
        assert snapped(image, panned(camera, 2.0)).reason is not None

    def test_a_lens_that_the_policy_does_not_expect_is_not_found(self, whole) -> None:
        start = panned(camera_of(960), 2.0)
        policy = CalibrationPolicy(distortion_mean=0.2, distortion_sigma=0.001)
        assert snapped(whole, start).reason is None
        assert snapped(whole, start, policy=policy).reason == PAINT_DISAGREES
