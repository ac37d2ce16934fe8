"""Tracks of a made ball whose way is known."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from app.geometry.arrays import FloatArray
from app.geometry.camera import Camera
from app.soccer.pitch import Pitch
from app.tracking.ball_solve import TrackOptions, track_ball
from app.tracking.ball_track import BallMeasurements, BallTrack, ViewErrors
from tests.bench.link import at_times, made_ball
from tests.cameras import looking

LEFT = looking((-10.0, 60.0, -14.0), (0.0, 0.0, 0.0), 1100.0)
RIGHT = looking((12.0, -58.0, -12.0), (0.0, 0.0, 0.0), 1100.0)
FPS = 25.0
BALL = made_ball(8.0, seed=3)
TIMES = np.arange(0.0, 7.6, 1 / FPS)
PLACES = at_times(BALL, TIMES)
FRAMES = 100 + np.arange(len(TIMES))
INSIDE_95 = 7.815
"""Chi-squared with three degrees of freedom."""


def seen(
    views: dict[str, Camera],
    *,
    noise: float = 0.5,
    places: FloatArray = PLACES,
    hide: Sequence[tuple[str, int, int]] = (),
) -> BallMeasurements:
    """A ball as cameras show it, without some stretches of some views."""
    generator = np.random.default_rng(5)
    parts: list[tuple[int, str, FloatArray]] = []
    for name, camera in views.items():
        pixels = camera.project(places) + generator.normal(0, noise, (len(places), 2))
        for row, pixel in enumerate(pixels):
            hidden = any(view == name and first <= row < last for view, first, last in hide)
            if np.isfinite(pixel).all() and not hidden:
                parts.append((row, name, pixel))
    rows = np.array([row for row, _, _ in parts])
    return BallMeasurements(
        FRAMES[rows],
        TIMES[rows],
        tuple(name for _, name, _ in parts),
        np.array([pixel for _, _, pixel in parts]),
        np.full(len(rows), max(noise, 0.3)),
        tuple(views[name] for _, name, _ in parts),
    )


def tracked(measurements: BallMeasurements, **options: float) -> BallTrack:
    return track_ball(
        measurements,
        FRAMES,
        TIMES,
        pitch=Pitch(),
        options=TrackOptions(**options),  # type: ignore[arg-type]
    )


BOTH = {"left": LEFT, "right": RIGHT}


@pytest.fixture(scope="module")
def track() -> BallTrack:
    return tracked(seen(BOTH))


class TestTwoViews:
    def test_the_ball_is_where_it_was(self, track: BallTrack) -> None:
        assert track.reason is None and set(track.state) == {"measured"}
        off = np.linalg.norm(track.position - PLACES, axis=1)
        assert np.median(off) < 0.03 and off.max() < 0.3

    def test_its_uncertainty_is_honest(self, track: BallTrack) -> None:
        off = track.position - PLACES
        inverse = np.linalg.inv(track.covariance[:, :3, :3])
        inside = np.einsum("ni,nij,nj->n", off, inverse, off) < INSIDE_95
        assert 0.88 <= inside.mean() <= 1.0
        assert np.median(track.sigma) < 0.06

    def test_velocities_are_those_of_the_ball(self, track: BallTrack) -> None:
        after, before = at_times(BALL, TIMES + 0.02), at_times(BALL, np.maximum(TIMES - 0.02, 0))
        off = np.linalg.norm(track.velocity - (after - before) / 0.04, axis=1)[1:]
        assert np.median(off) < 0.5

    def test_kicks_and_bounces_are_found_in_time(self, track: BallTrack) -> None:
        speed = np.diff(BALL[:, 1:], axis=0) / 0.02
        change = np.linalg.norm(np.diff(speed, axis=0), axis=1)
        real = BALL[1:-1][change > 2.5, 0]
        real = real[(real > 0.1) & (real < TIMES[-1] - 0.1)]
        found = np.array([event.time_s for event in track.events])
        assert len(real) >= 3
        assert all(np.abs(found - one).min() <= 2 / FPS for one in real)
        assert {event.kind for event in track.events} >= {"kick", "bounce"}

    def test_every_instant_left_out_is_predicted(self, track: BallTrack) -> None:
        told = track.left_out
        assert told is not None and told.predicted == 2 * len(FRAMES)
        assert told.median_px is not None and 0.4 < told.median_px < 1.2
        assert np.isfinite(told.by_frame).all()

    def test_the_same_comes_out_twice(self, track: BallTrack) -> None:
        again = tracked(seen(BOTH))
        assert np.array_equal(again.position, track.position)

    def test_the_order_of_measurements_does_not_matter(self, track: BallTrack) -> None:
        given = seen(BOTH)
        again = tracked(given.part(np.arange(len(given))[::-1]))
        assert np.allclose(again.position, track.position, atol=1e-3)


class TestHandover:
    """A view that takes over from another one, with a camera that puts the ball half a metre beside."""

    TILTED = looking((12.0, -58.0, -12.0), (0.0, 0.0, -0.3), 1100.0)
    LOB = np.array([-12.0, 2.0, -0.3]) + np.outer(TIMES, (10.0, 1.0, -12.0))

    def handed(self, camera: Camera, kicked: float = 0.0) -> BallTrack:
        """A lob whose second half another view sees than its first; what the camera of that is said to be."""
        rows = np.flatnonzero(TIMES < 2.2)
        places = self.LOB[rows].copy()
        places[:, 2] += 9.81 / 2 * TIMES[rows] ** 2
        places[:, 1] += kicked * np.maximum(TIMES[rows] - TIMES[28], 0.0)
        views = BOTH | {"other": RIGHT}
        hide = [("other", 0, 28), ("right", 28, len(TIMES))]
        given = seen(views, places=places, hide=hide)
        cameras = zip(given.views, given.cameras, strict=True)
        said = tuple(camera if view == "other" else one for view, one in cameras)
        given = replace(given, cameras=said)
        return track_ball(given, FRAMES[rows], TIMES[rows], pitch=Pitch())

    def test_the_jump_is_no_kick(self) -> None:
        track = self.handed(self.TILTED)
        aside = track.position[28, 1] - track.position[27, 1]
        assert track.reason is None and abs(aside) > 0.3
        assert track.events == () and track.contradicted == ()
        assert np.abs(np.diff(track.velocity[:, 1])).max() < 1.0

    def test_it_is_told_and_both_sides_are_less_sure(self) -> None:
        track, sound = self.handed(self.TILTED), self.handed(RIGHT)
        (jump,) = track.jumps
        assert sound.jumps == ()
        aside = abs(track.position[28, 1] - track.position[27, 1])
        assert jump.frame == FRAMES[28] and "other" in jump.views
        assert jump.metres == pytest.approx(aside, abs=0.15)
        near, far = slice(24, 32), slice(0, 3)
        assert (track.sigma[near] > 0.8 * jump.metres).all()
        assert track.sigma[near].min() > track.sigma[far].max() > sound.sigma[far].max()

    def test_a_kick_at_that_instant_is_one(self) -> None:
        for camera in (RIGHT, self.TILTED):
            track = self.handed(camera, kicked=-9.0)
            (kick,) = track.events
            assert kick.kind == "kick" and abs(kick.frame - FRAMES[28]) <= 2


class TestPart:
    """A few frames of a stretch whose cameras are not exact, which the whole knows and they alone do not."""

    def test_it_is_as_the_whole_has_it(self) -> None:
        said = looking((12.0, -58.0, -12.0), (0.0, 0.0, -0.35), 1100.0)
        given = seen(BOTH)
        cameras = zip(given.views, given.cameras, strict=True)
        given = replace(
            given, cameras=tuple(said if view == "right" else one for view, one in cameras)
        )
        whole = tracked(given)
        assert whole.reason is None and min(dict(whole.noise).values()) > 2
        rows = np.arange(20, 29)
        few = given.part(np.isin(given.frames, FRAMES[rows]))
        alone = track_ball(few, FRAMES[rows], TIMES[rows], pitch=Pitch())
        assert alone.reason is not None and "contradict" in alone.reason
        known = ViewErrors(dict(whole.noise), dict(whole.offsets))
        part = track_ball(few, FRAMES[rows], TIMES[rows], pitch=Pitch(), known=known)
        assert part.reason is None and set(part.state) == {"measured"}
        off = np.linalg.norm(part.position - whole.position[rows], axis=1)
        assert off.max() < 0.2

    def test_exact_cameras_are_not_said_to_be_noisy(self, track: BallTrack) -> None:
        assert all(times < 1.3 for _, times in track.noise)


class TestLeftOutFrames:
    def test_what_one_view_sees_and_what_none_sees_are_told_apart(self) -> None:
        track = tracked(seen(BOTH, hide=[("left", 40, 60), ("right", 50, 60)]))
        assert set(track.state[40:50]) == {"one_view"}
        assert set(track.state[50:60]) == {"bridged"}
        assert all(names == ("right",) for names in track.views[40:50])
        off = np.linalg.norm(track.position - PLACES, axis=1)[40:60]
        assert off.max() < 1.0

    def test_nothing_is_carried_across_a_long_gap(self) -> None:
        track = tracked(seen(BOTH, hide=[("left", 60, 130), ("right", 60, 130)]))
        assert track.state[59] == "measured" and track.state[95] == "gap"
        assert np.isnan(track.position[95]).all() and track.mode[95] == ""
        assert track.state[61] == "predicted" and track.sigma[61] < track.sigma[64]

    def test_a_slip_is_named_and_does_no_harm(self, track: BallTrack) -> None:
        given = seen(BOTH)
        pixels = given.pixels.copy()
        pixels[70] += (40.0, -25.0)
        spoilt = tracked(replace(given, pixels=pixels))
        assert [one.measurement for one in spoilt.contradicted] == [70]
        assert spoilt.contradicted[0].px == pytest.approx(47.2, abs=3)
        assert np.abs(spoilt.position - track.position).max() < 0.2


class TestOffsets:
    @pytest.mark.parametrize("late", [0.01, -0.03])
    def test_a_view_that_is_late_is_told(self, late: float) -> None:
        given = seen(BOTH)
        of_right = np.array([name == "right" for name in given.views])
        track = tracked(replace(given, times=given.times + np.where(of_right, late, 0.0)))
        assert [name for name, _ in track.offsets] == ["right"]
        assert track.offsets[0][1] == pytest.approx(-late, abs=0.003)
        assert np.median(np.linalg.norm(track.position - PLACES, axis=1)) < 0.03

    @pytest.mark.parametrize(
        "late", [{"a": 0.03}, {"b": -0.03}, {"a": 0.02, "b": 0.06}, {"left": 0.04, "a": -0.03}]
    )
    def test_views_that_most_others_contradict_are_the_late_ones(
        self, late: dict[str, float]
    ) -> None:
        more = {
            name: looking((x, y, -14.0), (0.0, 0.0, 0.0), 1600.0)
            for name, x, y in (("a", 40.0, 50.0), ("b", -40.0, -55.0), ("c", 35.0, -60.0))
        }
        given = seen({**BOTH, **more})
        off = np.array([late.get(name, 0.0) for name in given.views])
        track = tracked(replace(given, times=given.times + off))
        assert track.reason is None
        found = dict(track.offsets)
        assert found == pytest.approx({name: -one for name, one in late.items()}, abs=0.0015)
        off = track.position - PLACES
        inverse = np.linalg.inv(track.covariance[:, :3, :3])
        inside = np.einsum("ni,nij,nj->n", off, inverse, off) < INSIDE_95
        assert inside.mean() > 0.88

    def test_views_in_time_are_left_alone(self, track: BallTrack) -> None:
        assert track.offsets == ()

    def test_views_between_frames_take_part(self) -> None:
        later = TIMES + 0.017
        given = seen(BOTH, places=at_times(BALL, later))
        of_right = np.array([name == "right" for name in given.views])
        in_time = seen(BOTH)
        mixed = replace(
            given,
            times=np.where(of_right, given.times + 0.017, given.times),
            pixels=np.where(of_right[:, None], given.pixels, in_time.pixels),
        )
        track = tracked(mixed)
        assert track.offsets == () and "measured" in track.state
        assert np.median(np.linalg.norm(track.position - PLACES, axis=1)) < 0.03


class TestOneView:
    def test_its_uncertainty_is_large_and_honest(self) -> None:
        track = tracked(seen({"right": RIGHT}))
        known = np.isfinite(track.position).all(axis=1)
        assert known.mean() > 0.55 and "measured" not in track.state
        off = (track.position - PLACES)[known]
        inverse = np.linalg.inv(track.covariance[known][:, :3, :3])
        inside = np.einsum("ni,nij,nj->n", off, inverse, off) < INSIDE_95
        assert inside.mean() > 0.8
        assert (np.linalg.norm(off, axis=1) < 1.0).mean() > 0.66

    def test_it_is_wider_farther_than_two_seconds_from_what_two_views_see(self) -> None:
        """The second view ends at two seconds; without it the sigma is wider before that, too."""
        both = tracked(seen(BOTH, hide=[("left", 50, len(TIMES))]), most_sigma_m=9.0)
        alone = tracked(seen({"right": RIGHT}), most_sigma_m=9.0)
        times = alone.sigma / both.sigma
        assert (times[80:98] > 1.25).all()
        assert both.sigma[100] / both.sigma[99] > 1.2
        assert times[-1] == pytest.approx(1, abs=0.05)

    def test_a_ball_that_stays_in_the_air_is_refused(self) -> None:
        times = TIMES[:30]
        places = np.column_stack([20 * times - 15, 5 * times, -6.0 + 4.9 * (times - 0.6) ** 2])
        given = seen({"right": RIGHT}, places=np.vstack([places, PLACES[30:]]))
        track = tracked(given.part(given.frames < 130))
        assert track.reason is not None and "no bounce, kick or known height" in track.reason

    def test_sizes_say_what_rays_leave_open(self) -> None:
        times = TIMES[:30]
        places = np.column_stack([20 * times - 15, 5 * times, -6.0 + 4.9 * (times - 0.6) ** 2])
        given = seen({"right": RIGHT}, places=np.vstack([places, PLACES[30:]]))
        given = given.part(given.frames < 130)
        sizes = 0.226 * 1100 / RIGHT.pitch_to_camera(places)[:, 2]
        track = tracked(replace(given, sizes=sizes, size_sigma=np.full(len(sizes), 0.1)))
        assert track.reason is None
        known = np.isfinite(track.position[:30]).all(axis=1)
        off = np.linalg.norm(track.position[:30][known] - places[known], axis=1)
        assert known.mean() > 0.5 and np.median(off) < 2 * np.median(track.sigma[:30][known])


class TestNonsense:
    """What is no ball is said, without a crash."""

    def test_one_measurement(self) -> None:
        track = tracked(seen(BOTH).part(np.array([3])))
        assert track.reason == "The ball is measured at 1 instants; a track needs 6."
        assert set(track.state) == {"gap"}

    def test_nothing(self) -> None:
        assert tracked(seen(BOTH).part(np.zeros(0, dtype=int))).reason is not None

    def test_no_frames(self) -> None:
        given = seen(BOTH)
        track = track_ball(given, FRAMES[:0], TIMES[:0], pitch=Pitch())
        assert track.reason == "The stretch has no frames." and track.state == ()

    def test_a_pixel_without_a_ray_is_left_out(self) -> None:
        given = seen(BOTH)
        pixels = given.pixels.copy()
        pixels[10] = np.nan
        track = tracked(replace(given, pixels=pixels))
        assert track.reason is None and track.state[10] == "one_view"

    def test_one_of_three_views_is_of_another_ball(self) -> None:
        third = looking((50.0, 40.0, -15.0), (0.0, 0.0, 0.0), 1100.0)
        given = seen({**BOTH, "third": third})
        of_third = np.array([name == "third" for name in given.views])
        other = third.project(PLACES[::-1])[: int(of_third.sum())]
        pixels = given.pixels.copy()
        pixels[of_third] = other
        track = tracked(replace(given, pixels=pixels))
        assert track.reason is not None and "contradict" in track.reason

    def test_one_frame_a_second(self) -> None:
        given = seen(BOTH)
        track = tracked(given.part(given.frames % 25 == 0))
        assert track.reason is not None and "four a second" in track.reason

    def test_a_mirrored_camera(self) -> None:
        given = seen(BOTH)
        pixels = given.pixels.copy()
        of_left = np.array([name == "left" for name in given.views])
        pixels[of_left, 0] = 1279 - pixels[of_left, 0]
        assert "contradict" in (tracked(replace(given, pixels=pixels)).reason or "")

    def test_two_balls(self) -> None:
        other = seen({"right": RIGHT}, places=np.add(PLACES[::-1], (6.0, 9.0, 0.0)))
        one = seen({"left": LEFT})
        both = BallMeasurements(
            np.concatenate([one.frames, other.frames]),
            np.concatenate([one.times, other.times]),
            one.views + other.views,
            np.concatenate([one.pixels, other.pixels]),
            np.concatenate([one.sigma, other.sigma]),
            one.cameras + other.cameras,
        )
        assert "contradict" in (tracked(both).reason or "")

    def test_a_wrong_offset(self) -> None:
        given = seen(BOTH)
        of_left = np.array([name == "left" for name in given.views])
        late = replace(given, times=given.times + np.where(of_left, 1.0, 0.0))
        assert "contradict" in (tracked(late).reason or "")
