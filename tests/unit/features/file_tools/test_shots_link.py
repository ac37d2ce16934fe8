from __future__ import annotations

import json
import os
import stat
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from app.errors import ReviewError
from app.features.file_tools.shots import link_live_and_replay, parse_hint
from tests.bench.link import Filmed, made_ball, plant
from tests.cameras import write_cameras

PLANTED = plant(made_ball(), 2, speed=0.5, noise_px=0.4, missing=0.1, stand=(0.0, -75.0, -18.0))
KEYS = {"outcome", "offset_s", "speed", "offset_sigma_s", "speed_sigma", "miss_m"}


def write_view(folder: Path, view: Filmed, extra: str = "") -> Path:
    """A view as ``track`` and a detector leave it; frames count from 7."""
    folder.mkdir()
    write_cameras(folder, {f"{7 + at:05d}": camera for at, camera in enumerate(view.cameras)})
    rows = [
        f"{7 + at},{time!r},{x!r},{y!r}"
        for at, (time, (x, y)) in enumerate(
            zip(view.times.tolist(), view.pixels.tolist(), strict=True)
        )
    ]
    (folder / "ball.csv").write_text("\n".join(["frame,time_s,x,y", *rows]) + "\n" + extra)
    return folder


@pytest.fixture
def views(tmp_path: Path) -> tuple[Path, Path, Path]:
    live, replay = (
        write_view(tmp_path / name, view)
        for name, view in (("live", PLANTED.live), ("replay", PLANTED.replay))
    )
    return live, replay, tmp_path / "out"


class TestLinkFiles:
    def test_the_map_is_written(self, views: tuple[Path, Path, Path]) -> None:
        before = os.umask(0o022)
        try:
            result = link_live_and_replay(*views)
        finally:
            os.umask(before)
        assert stat.S_IMODE((views[2] / "link.json").stat().st_mode) == 0o644
        assert json.loads((views[2] / "link.json").read_text()) == result
        assert result.keys() >= KEYS
        assert result["outcome"] == "linked"
        assert result["found_by"] == "ball"
        assert result["speed"] == pytest.approx(PLANTED.speed, rel=0.01)
        assert abs(result["offset_s"] - PLANTED.offset) < 4 * result["offset_sigma_s"]
        assert result["pieces"] == result["problems"] == []

    def test_what_is_left_out_is_counted(self, views: tuple[Path, Path, Path]) -> None:
        live, _, out = views
        (live / "camera_00009.json").unlink()
        with (live / "ball.csv").open("a") as file:
            file.write("9000,99.0,,\n9001,1.0,abc,2\n7,0.5,1,1\n9002,0.001,5,5\n")
        problems = link_live_and_replay(*views)["problems"]
        assert any('x: is "abc", which is not a number' in one for one in problems)
        assert any("7 is listed twice" in one for one in problems)
        assert any("2 of" in one and "have no camera" in one for one in problems)
        assert out.is_dir()

    def test_times_may_count_from_1970(self, tmp_path: Path) -> None:
        folders = [
            write_view(tmp_path / name, replace(view, times=view.times + 1764588000.0))
            for name, view in (("live", PLANTED.live), ("replay", PLANTED.replay))
        ]
        result = link_live_and_replay(*folders, tmp_path / "out")
        assert result["outcome"] == "linked" and result["problems"] == []
        assert result["speed"] == pytest.approx(PLANTED.speed, rel=0.01)

    def test_times_in_milliseconds_are_refused_at_once(self, tmp_path: Path) -> None:
        folders = [
            write_view(tmp_path / name, replace(view, times=view.times * 1000.0))
            for name, view in (("live", PLANTED.live), ("replay", PLANTED.replay))
        ]
        result = link_live_and_replay(*folders, tmp_path / "out")
        assert result["outcome"] == "unobservable"
        assert result["reason"] == (
            "The frames of the live shot that show the ball are 40 s apart; a link needs them within 0.2 s of live "
            "time. Times are in seconds."
        )

    def test_two_frames_of_one_time(self, views: tuple[Path, Path, Path]) -> None:
        path = views[0] / "ball.csv"
        lines = path.read_text().splitlines()
        lines[5] = ",".join([lines[5].split(",")[0], *lines[4].split(",")[1:]])
        path.write_text("\n".join(lines))
        assert any(
            "1 frames have the time of another" in one
            for one in link_live_and_replay(*views)["problems"]
        )

    @pytest.mark.parametrize(
        ("change", "said"),
        [
            (lambda live: (live / "ball.csv").unlink(), "frame,time_s,x,y"),
            (lambda live: (live / "ball.csv").write_text("frame,x,y\n1,2,3\n"), "time_s"),
            (
                lambda live: (live / "ball.csv").write_text("frame,time_s,x,y\n"),
                "has no row with a ball",
            ),
            (
                lambda live: (live / "ball.csv").write_text("frame,time_s,x,y\n7,1e40,2,3\n"),
                'is "1e40", which is not a number',
            ),
            (
                lambda live: [one.unlink() for one in live.glob("camera_*")],
                "contains no camera files",
            ),
            (
                lambda live: (live / "ball.csv").write_text("frame,time_s,x,y\n99999,2,3,4\n"),
                "has its camera_<frame>.json beside it",
            ),
        ],
    )
    def test_folders_that_hold_something_else(
        self, views: tuple[Path, Path, Path], change: Callable[[Path], object], said: str
    ) -> None:
        change(views[0])
        with pytest.raises(ReviewError, match=said):
            link_live_and_replay(*views)


class TestParseHint:
    def test_two_times(self) -> None:
        assert parse_hint("12.48=3.2") == (12.48, 3.2)
        assert parse_hint(" -1 = 2e1 ") == (-1.0, 20.0)

    @pytest.mark.parametrize("text", ["12.48", "a=b", "1=2=3", "=", "nan=1", "1..2=3"])
    def test_anything_else(self, text: str) -> None:
        with pytest.raises(ValueError):
            parse_hint(text)


class TestCommand:
    def test_json_is_the_file(
        self, views: tuple[Path, Path, Path], touchline: Callable[..., tuple[int, str, str]]
    ) -> None:
        code, out, _ = touchline("link", *views, "--json")
        assert code == 0
        assert json.loads(out) == json.loads((views[2] / "link.json").read_text())

    def test_a_ball_at_rest_is_refused_in_words_and_two_instants_link_it(
        self, tmp_path: Path, touchline: Callable[..., tuple[int, str, str]]
    ) -> None:
        times = np.arange(0, 60, 0.02)
        rest = np.column_stack([times, *np.full((2, len(times)), 5.0), np.full(len(times), -0.11)])
        planted = plant(rest, 0, speed=0.5)
        folders = [
            write_view(tmp_path / name, view)
            for name, view in (("live", planted.live), ("replay", planted.replay))
        ]
        code, out, _ = touchline("link", *folders, tmp_path / "out")
        assert code == 0
        assert "unobservable" in out
        assert "The ball hardly moves" in out
        first = planted.replay.times[0]
        at = [f"{planted.offset + planted.speed * t:.2f}={t:.2f}" for t in (first + 1, first + 5)]
        code, out, _ = touchline(
            "link", *folders, tmp_path / "out", "--at", at[0], "--at", at[1], "--json"
        )
        assert json.loads(out)["outcome"] == "linked"

    def test_an_instant_that_is_none(
        self, views: tuple[Path, Path, Path], touchline: Callable[..., tuple[int, str, str]]
    ) -> None:
        code, _, err = touchline("link", *views, "--at", "soon")
        assert code == 2
        assert "LIVE_TIME=REPLAY_TIME" in err
