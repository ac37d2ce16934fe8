from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest

from app.errors import InputError
from app.features.tracks import stretches as stretches_module
from app.features.tracks.codec import TrackInputs, make_track
from app.features.tracks.stored import format_unused_balls
from app.features.tracks.stretches import (
    RATE,
    Stretch,
    find_group_instant,
    gather_stretches,
    match_stored_to_stretches,
    require_any_stretch,
)
from app.formats.export_record import ExportRecord
from app.soccer.annotation import BallAnnotation, Extras
from app.soccer.frames import ImagePoint
from app.soccer.group import Group, Station, View
from app.soccer.policy import PAPER
from app.solving.solve import solve_group
from tests.bench.link import at_times, film, made_ball
from tests.cameras import SIZE
from tests.flights import FIRST, flight_groups
from tests.rigs import TRUTH


def record(group: Group) -> ExportRecord:
    return ExportRecord(group, solve_group(group, PAPER), "unreviewed")


def recorded(group: Group, frame: int, name: str = "final") -> Group:
    """A group as instants of a recording are: one view, with its time stamp."""
    said = {"recording": {"name": name, "frame": frame, "seconds": 10 + frame / 50}}
    view = replace(group.views[0], key=f"{frame}.png", extras=Extras(metadata=said))
    return replace(group, key=f"{name}/{frame}.png", match=name, views=(view,))


@pytest.fixture(scope="module")
def records() -> list[ExportRecord]:
    return [record(group) for group in flight_groups(20)]


def only(stretches: list[Stretch]) -> Stretch:
    (stretch,) = stretches
    return stretch


class TestGatherStretches:
    def test_a_rig_is_one_stretch_with_a_row_for_every_frame(self, records) -> None:
        stretch = only(gather_stretches([*reversed(records[:5]), *records[9:]], PAPER))
        assert (stretch.key, stretch.rate) == ("rig", RATE)
        assert stretch.frames.tolist() == list(range(FIRST, FIRST + 20))
        assert np.allclose(stretch.times, stretch.frames / RATE)
        assert stretch.groups[FIRST + 9] == str(FIRST + 9)
        assert FIRST + 6 not in stretch.groups

    def test_measures_every_ball_with_its_camera_once(self, records) -> None:
        measured = only(gather_stretches(records, PAPER)).measurements
        assert len(measured) == sum(len(item.group.views) for item in records)
        assert set(measured.views) == set(TRUTH)
        assert len({id(camera) for camera in measured.cameras}) == 4
        first = records[0].group.views[0]
        assert measured.pixels[0].tolist() == [*first.ball.center]

    def test_noise_is_that_of_the_policy(self, records) -> None:
        usual = only(gather_stretches(records, PAPER)).measurements.sigma
        noisy = replace(PAPER, click_sigma_px=3.0)
        assert np.allclose(only(gather_stretches(records, noisy)).measurements.sigma, 3 * usual)

    def test_counts_balls_that_are_not_used_by_reason(self, records) -> None:
        views = records[3].group.views
        out = replace(records[3].group, views=(replace(views[0], included=False), *views[1:]))
        unsolved = replace(records[4], solution=None)
        stretch = only(gather_stretches([*records[:3], record(out), unsolved], PAPER))
        assert stretch.unused == {"view left out": 1, "not solved": len(records[4].group.views)}
        assert (
            format_unused_balls(stretch.unused)
            == "Not measured: 4 balls (not solved), 1 ball (view left out)."
        )

    @pytest.mark.parametrize(("source", "count"), [("points_lines", 1), ("given", 0)])
    def test_a_camera_that_its_lines_leave_open_measures_no_ball(
        self, records, source, count
    ) -> None:
        first, *others = records[0].solution.views
        open_camera = replace(first.calibration, source=source, covariance=None)
        views = (replace(first, calibration=open_camera), *others)
        opened = replace(records[0], solution=replace(records[0].solution, views=views))
        stretch = only(gather_stretches([opened, *records[1:3]], PAPER))
        every = sum(len(item.group.views) for item in records[:3])
        assert len(stretch.measurements) == every - count
        assert stretch.unused.get("camera whose lines leave it open", 0) == count
        assert records[0].group.key in stretch.groups.values()

    def test_two_groups_of_one_frame_are_refused_by_their_keys(self, records) -> None:
        twice = replace(records[0], group=replace(records[0].group, key=f"late/{FIRST}.png"))
        with pytest.raises(
            InputError, match=f"{FIRST} and late/{FIRST}.png are both frame {FIRST}"
        ):
            gather_stretches([records[0], twice], PAPER)

    def test_a_recording_is_cut_where_its_shots_are(self) -> None:
        groups = [recorded(group, frame) for frame, group in enumerate(flight_groups(12))]
        stretches = gather_stretches(map(record, groups), PAPER, {"final": [(0, 4), (6, 20)]})
        assert [item.key for item in stretches][:2] == ["final 0-4", "final 5-5"]
        assert stretches[2].key == "final 6-20"
        assert stretches[0].rate == pytest.approx(50)
        assert stretches[0].times[0] == 10

    def test_a_linked_view_is_one_of_its_own_at_its_own_time(self) -> None:
        group = flight_groups(1)[0]
        told = {"name": "final", "seconds": 90.0, "link": 3, "off_s": 0.015, "repeated": False}
        one, two, three = (
            replace(view, key=f"{at}.png", extras=Extras(metadata={"recording": said}))
            for at, view, said in zip(
                (100, 4000, 4001),
                group.views,
                (
                    {"name": "final", "frame": 100, "seconds": 12.0},
                    {**told, "frame": 4000},
                    {**told, "frame": 4001, "repeated": True},
                ),
                strict=False,
            )
        )
        linked = replace(group, key="final/100.png", match="final", views=(one, two, three))
        stretch = only(gather_stretches([record(linked)], PAPER))
        assert stretch.measurements.views == ("final", "final link 3")
        assert stretch.measurements.times.tolist() == [12.0, 12.015]
        assert {name: list(by_frame) for name, by_frame in stretch.cameras.items()} == {
            "final": [100],
            "final link 3": [100],
        }
        assert stretch.unused == {"frame that repeats the one before": 1}

    @pytest.mark.parametrize("known", [True, False])
    def test_a_slow_replay_of_a_panning_camera_measures_the_ball_at_its_own_times(
        self, known: bool
    ) -> None:
        """Its frames are a third of a live frame beside the live ones; where its map does not say so, the ball does."""
        ball, off_s = made_ball(5.0, seed=3), 0.0133
        times = 0.4 + np.arange(75) / 25
        generator = np.random.default_rng(1)
        live = film(at_times(ball, times), times, (0.0, 62.0, -16.0), 1900.0)
        replay = film(at_times(ball, times + off_s), times, (24.0, -58.0, -14.0), 2200.0)
        groups = []
        for frame, time in enumerate(times.tolist()):
            told = {"name": "final", "frame": frame, "seconds": time}
            other = {"name": "final", "frame": 500 + 2 * frame, "seconds": 90.0, "link": 3}
            other["off_s"] = off_s if known else 0.0
            views = []
            for number, filmed, said in ((frame, live, told), (500 + 2 * frame, replay, other)):
                pixel = filmed.pixels[frame] + generator.normal(0, 0.3, 2)
                station = Station(f"{frame}/{number}", SIZE, given=filmed.cameras[frame])
                point = BallAnnotation(point=ImagePoint(*pixel.tolist()))
                extras = Extras(metadata={"recording": said})
                views.append(View(f"{number}.png", station, (point,), extras=extras))
            groups.append(Group(f"final/{frame}.png", tuple(views), match="final"))
        stretch = only(gather_stretches(map(record, groups), PAPER, {"final": [(0, 99)]}))
        assert stretch.measurements.view_names == ("final", "final link 3")
        track = make_track(TrackInputs.of(stretch))
        assert track.reason is None
        off = np.linalg.norm(track.position - at_times(ball, times), axis=1)
        both = sum(views == ("final", "final link 3") for views in track.views)
        assert both >= 65 and track.state.count("measured") >= 65
        assert np.nanmedian(off) < 0.06
        late = dict(track.offsets)
        assert late.get("final link 3", 0.0) - late.get("final", 0.0) == pytest.approx(
            0.0 if known else off_s, abs=0.004
        )

    def test_a_recording_without_shots_is_cut_at_long_gaps(self) -> None:
        numbers = [0, 10, 20, 400, 410]
        groups = [recorded(item, n) for item, n in zip(flight_groups(5), numbers, strict=True)]
        stretches = gather_stretches(map(record, groups), PAPER)
        assert [item.key for item in stretches] == ["final 0-20", "final 400-410"]
        assert len(stretches[0].frames) == 21
        assert np.allclose(stretches[0].times, 10 + np.arange(21) / 50)
        assert stretches[0].measurements.view_names == ("final",)

    def test_a_recording_without_shots_is_cut_where_a_track_would_be_too_long(
        self, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr(stretches_module, "MOST_FRAMES", 8)
        groups = [recorded(group, frame) for frame, group in enumerate(flight_groups(12))]
        found = gather_stretches(map(record, groups), PAPER)
        assert [item.key for item in found] == ["final 0-7", "final 8-11"]

    def test_groups_that_say_no_time_are_in_none(self, make_group) -> None:
        found = gather_stretches([record(make_group())], PAPER)
        assert found == []
        with pytest.raises(InputError, match='no groups of "demo" follow each other in time'):
            require_any_stretch("demo", found)


@dataclass(frozen=True)
class Stored:
    key: str
    match: str
    first: int
    last: int


class TestStoredAs:
    """What was stored of a stretch is found again when groups come and cuts move."""

    @staticmethod
    def stretches(*numbers: int) -> list[Stretch]:
        groups = [
            recorded(item, n) for item, n in zip(flight_groups(len(numbers)), numbers, strict=True)
        ]
        return gather_stretches(map(record, groups), PAPER)

    def test_one_more_instant_makes_it_no_other(self) -> None:
        before, other = Stored("final 0-20", "final", 0, 20), Stored("cup 0-30", "cup", 0, 30)
        (stretch,) = self.stretches(0, 10, 20, 30)
        assert stretch.key == "final 0-30"
        assert match_stored_to_stretches([stretch], [other, before]) == {"final 0-30": before}

    def test_the_larger_part_of_what_was_cut_has_it(self) -> None:
        whole = Stored("final 0-410", "final", 0, 410)
        found = self.stretches(0, 10, 390, 410, 420)
        assert match_stored_to_stretches(found, [whole]) == {"final 390-420": whole}

    def test_the_same_key_counts_before_what_is_shared(self) -> None:
        same, more = Stored("final 0-20", "final", 0, 20), Stored("final 0-25", "final", 0, 25)
        (stretch,) = self.stretches(0, 10, 20)
        assert match_stored_to_stretches([stretch], [more, same]) == {"final 0-20": same}

    def test_nothing_is_of_two_and_nothing_is_found_where_nothing_is_shared(self) -> None:
        first = Stored("final 0-15", "final", 0, 15)
        found = self.stretches(0, 20, 400, 410)
        assert match_stored_to_stretches(found, [first]) == {"final 0-20": first}


class TestInstantOf:
    def test_of_a_rig_by_the_number_of_the_frame(self) -> None:
        instant, from_file = find_group_instant(flight_groups(1)[0])
        assert (instant.frame, instant.time, from_file) == (FIRST, FIRST / RATE, False)

    def test_of_a_recording_by_its_time_stamp(self) -> None:
        instant, from_file = find_group_instant(recorded(flight_groups(1)[0], 7))
        assert (instant.frame, instant.time, from_file) == (7, 10.14, True)
