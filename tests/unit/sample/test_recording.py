from __future__ import annotations

import json
from itertools import pairwise
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from app.errors import InputError
from app.formats.camera_json import camera_from_json
from app.sample import RECORDING_SECONDS
from app.sample.recording import FPS, PARTS, ShotPlan, draw_logo, plan_shots, write_recording
from tests.bench.shots import read_clip

PIECE = (
    ShotPlan("main", 1.6, "start"),
    ShotPlan("replay", 1.6, "wipe", 0.25, 1),
    ShotPlan("closeup", 0.6, "wipe"),
)


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("recording") / "film.mp4"
    write_recording(out, parts=PIECE)
    return out


@pytest.fixture(scope="module")
def truth(written: Path) -> dict[str, Any]:
    value: dict[str, Any] = json.loads(written.with_suffix(".json").read_text(encoding="utf-8"))
    return value


@pytest.fixture(scope="module")
def pictures(written: Path) -> list[np.ndarray]:
    return read_clip(written)


class TestPartsOf:
    def test_three_minutes_hold_what_a_broadcast_has(self) -> None:
        assert sum(part.seconds for part in PARTS) == RECORDING_SECONDS
        kinds = [part.kind for part in PARTS]
        assert {"main", "replay", "closeup", "other"} == set(kinds)
        assert sorted(part.speed for part in PARTS if part.kind == "replay") == [0.25, 0.5]
        for one, other in pairwise(PARTS):
            assert ("replay" in (one.kind, other.kind)) == (other.entered_by == "wipe")
        assert "dissolve" in {part.entered_by for part in PARTS}

    @pytest.mark.parametrize(("seconds", "shots"), [(36, 11), (180, 11), (600, 33)])
    def test_it_is_as_long_as_it_shall_be(self, seconds: float, shots: int) -> None:
        parts = plan_shots(seconds)
        assert sum(part.seconds for part in parts) == pytest.approx(seconds)
        assert len(parts) == shots
        assert [part.entered_by for part in parts].count("start") == 1

    def test_too_short_a_one_is_refused(self) -> None:
        with pytest.raises(InputError, match="at least 36 seconds"):
            plan_shots(20)


class TestWriteRecording:
    def test_the_truth_counts_the_frames_of_the_video(
        self, truth: dict[str, Any], pictures: list[np.ndarray]
    ) -> None:
        assert len(pictures) == truth["frames"] == round(3.8 * FPS)
        assert [(s["first"], s["last"], s["kind"], s["entered_by"]) for s in truth["shots"]] == [
            (0, 30, "main", "start"),
            (49, 70, "replay", "wipe"),
            (89, 94, "closeup", "wipe"),
        ]
        assert [row["frame"] for row in truth["each"]] == [
            *range(31),
            *range(49, 71),
            *range(89, 95),
        ]

    def test_a_replay_shows_what_its_link_says(self, truth: dict[str, Any]) -> None:
        (link,) = truth["links"]
        assert (link["live"], link["replay"], link["speed"]) == (0, 1, 0.25)
        replay = [row for row in truth["each"] if row["shot"] == 1]
        for row in replay:
            live = link["offset_s"] + link["speed"] * row["frame"] / FPS
            late = live - row["play_s"]
            # Every other frame of a camera of 50 pictures a second shows an earlier one.
            again = row["frame"] % 2 == 1
            assert late == pytest.approx(0.01 if again else 0.0, abs=1e-9)
            assert row["repeats"] == (again and row["frame"] > 49)
        assert 0.4 < np.mean([row["repeats"] for row in replay]) < 0.6

    def test_repeated_frames_are_the_same_picture(
        self, truth: dict[str, Any], pictures: list[np.ndarray]
    ) -> None:
        def moved(frame: int) -> float:
            return float(cv2.absdiff(pictures[frame], pictures[frame - 1]).mean())

        replay = [row for row in truth["each"] if row["shot"] == 1][1:]
        again = [moved(row["frame"]) for row in replay if row["repeats"]]
        anew = [moved(row["frame"]) for row in replay if not row["repeats"]]
        assert max(again) < 0.5 * min(anew)

    def test_the_ball_is_white_where_the_truth_says(
        self, truth: dict[str, Any], pictures: list[np.ndarray]
    ) -> None:
        seen = [
            row for row in truth["each"] if row["pixel"] and not row["hidden"] and row["shot"] < 2
        ]
        assert len(seen) > 40
        brighter = []
        for row in seen:
            camera = camera_from_json(row["camera"], "truth")
            x, y = camera.project(np.array([row["ball"]]))[0]
            assert (x, y) == pytest.approx(row["pixel"], abs=1e-6)
            assert 3 < row["diameter_px"] < 20
            least = pictures[row["frame"]].min(axis=2)
            on = least[round(y) - 1 : round(y) + 2, round(x) - 1 : round(x) + 2].max()
            around = np.median(
                least[max(round(y) - 20, 0) : round(y) + 21, round(x) - 20 : round(x) + 21]
            )
            brighter.append(float(on) - float(around))
        assert np.percentile(brighter, 10) > 30

    def test_the_same_arguments_give_the_same_bytes(self, tmp_path: Path) -> None:
        parts = [ShotPlan("main", 0.4, "start")]
        for name in ("a.mp4", "b.mp4"):
            write_recording(tmp_path / name, parts=parts)
        write_recording(tmp_path / "c.mp4", parts=parts, seed=7)
        films = [(tmp_path / f"{name}.mp4").read_bytes() for name in "abc"]
        truths = [(tmp_path / f"{name}.json").read_bytes() for name in "abc"]
        assert films[0] == films[1] != films[2]
        assert truths[0] == truths[1] != truths[2]

    def test_play_that_has_gone_on_goes_on(self, tmp_path: Path) -> None:
        parts = [ShotPlan("main", 1.2, "start"), ShotPlan("replay", 0.4, "cut", 0.5)]
        write_recording(tmp_path / "film.mp4", parts=parts, since=30.0)
        truth = json.loads((tmp_path / "film.json").read_text(encoding="utf-8"))
        (link,) = truth["links"]
        for row in truth["each"]:
            shown = row["frame"] / FPS
            if row["shot"] == 1:
                shown = link["offset_s"] + link["speed"] * shown
            assert row["play_s"] == pytest.approx(30.0 + shown, abs=1e-9)

    def test_a_blended_replay_mixes_its_pictures(self, tmp_path: Path) -> None:
        parts = [ShotPlan("main", 1.2, "start"), ShotPlan("replay", 0.8, "cut", 0.25, 1, "blend")]
        write_recording(tmp_path / "film.avi", parts=parts)
        rows = json.loads((tmp_path / "film.json").read_text(encoding="utf-8"))["each"]
        mixes = [row["mixes"] for row in rows if row["shot"] == 1]
        assert mixes == [number % 2 == 1 for number in range(20)]
        assert not any(row["repeats"] for row in rows)

    @pytest.mark.parametrize(
        ("name", "parts", "message"),
        [
            ("film.txt", None, "does not end in .mp4, .avi or .mkv"),
            ("film.mp4", [ShotPlan("replay", 3, "start", 0.5)], "no live shot comes before it"),
            (
                "film.mp4",
                [ShotPlan("main", 1, "start"), ShotPlan("replay", 8, "cut", 0.5)],
                "longer than",
            ),
            (
                "film.mp4",
                [
                    ShotPlan("main", 0.4, "start"),
                    ShotPlan("main", 0.4, "wipe"),
                    ShotPlan("main", 1, "wipe"),
                ],
                "must be longer",
            ),
        ],
    )
    def test_what_cannot_be_shown_is_refused_and_nothing_left(
        self, tmp_path: Path, name: str, parts: list[ShotPlan] | None, message: str
    ) -> None:
        with pytest.raises(InputError, match=message):
            write_recording(tmp_path / name, parts=parts)
        assert list(tmp_path.iterdir()) == []

    def test_a_writer_that_fails_leaves_nothing(self, tmp_path: Path) -> None:
        def stop(done: int, total: int, what: str = "") -> None:
            raise KeyboardInterrupt

        with pytest.raises(KeyboardInterrupt):
            write_recording(
                tmp_path / "film.mp4", parts=[ShotPlan("main", 0.4, "start")], progress=stop
            )
        assert list(tmp_path.iterdir()) == []


class TestDrawLogo:
    def test_it_covers_all_in_its_middle_and_little_at_its_ends(self) -> None:
        grey = np.full((180, 320, 3), 99, np.uint8)
        covered = [
            float((draw_logo(grey.copy(), share) != 99).any(axis=2).mean())
            for share in (0.05, 0.5, 0.95)
        ]
        assert covered[1] == 1.0
        assert max(covered[0], covered[2]) < 0.5
