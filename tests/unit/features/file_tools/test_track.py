"""``touchline track``: a clip to camera files."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from app.errors import InputError
from app.features.file_tools import track
from app.features.file_tools.track import (
    count_outcomes,
    frame_to_row,
    pitch_to_row,
    track_cameras_of_clip,
)
from app.formats.cameras import read_cameras
from app.formats.report import ReaderReport
from app.soccer.frames import ImageSize
from app.soccer.pitch import Pitch
from app.soccer.policy import CalibrationPolicy
from app.solving.lone_frame import CROWN_SIGMA_M, PAINT_SIZE_SIGMA_M
from app.solving.paint_noise import CROWN, SIZES, TERMS
from app.solving.tripod_pitch import SHARED, TripodPitch
from app.tracking.track import CameraTrack, FrameCamera
from tests.tracked_frames import CAMERA, frame
from tests.unit.tracking.test_clip import write

Run = Callable[..., tuple[int, str, str]]


def _shown() -> TripodPitch:
    """A pitch of 101 x 68 m with a crown of 0.16 m, each number known to a tenth of its prior."""
    shared, terms = np.zeros(SHARED), np.zeros(TERMS)
    terms[CROWN], terms[SIZES.start] = 0.16 / CROWN_SIGMA_M, -4 / PAINT_SIZE_SIGMA_M[0]
    shared[:3], shared[SHARED - TERMS :] = (0.5, 66.0, -15.0), terms
    covariance, spread = 0.01 * np.eye(SHARED), np.zeros((3, 3))
    size = ImageSize(960, 540)
    return TripodPitch(Pitch(), size, 24, shared, covariance, 7.0, 1.0, spread, CalibrationPolicy())


SHOWN = _shown()


@pytest.fixture
def found(monkeypatch: pytest.MonkeyPatch) -> list[FrameCamera]:
    """What the worker process returns, in place of a process that follows a film."""
    frames = [frame(0, "tracked"), frame(1, "bridged"), frame(2, "lost")]

    class Worker:
        def __init__(self, limits: object) -> None:
            pass

        def run(self, *arguments: object, on_message: Callable[[int], None]) -> CameraTrack:
            on_message(3)
            return CameraTrack(frames, SHOWN, [frames[1], frames[1], frames[2]])

        def close(self) -> None:
            pass

    monkeypatch.setattr(track, "WorkerProcess", Worker)
    return frames


def test_files_of_cameras_and_the_outcome_of_each_frame_are_written(
    found: list[FrameCamera], tmp_path: Path, touchline: Run
):
    clip, out = tmp_path / "clip.mp4", tmp_path / "out"
    clip.touch()
    out.mkdir()
    (out / "camera_2.json").write_text("of an earlier run")
    code, told, _ = touchline("track", clip, out, "--json")
    result = json.loads(told)
    assert code == 0
    assert result == json.loads((out / "track.json").read_text())
    rows = result["frames"]
    assert [row["outcome"] for row in rows] == ["tracked", "bridged", "lost"]
    assert [row["keyframe"] for row in rows] == [True, False, False]
    assert rows[1]["time"] == pytest.approx(0.04)
    assert rows[0]["sigma"]["position"] == pytest.approx(0.4)
    assert rows[0]["sigma"]["focal_px"] == pytest.approx(9.0)
    assert rows[0]["pan"] == pytest.approx(CAMERA.pan_tilt_roll_degrees[0])
    assert rows[2]["pan"] is None and rows[2]["reason"] == "no_paint"
    names = sorted(file.name for file in out.iterdir())
    assert names == ["camera_0.json", "camera_1.json", "track.json"]
    cameras = read_cameras(out, ReaderReport())
    assert cameras["0"].position == pytest.approx(CAMERA.position)
    code, told, _ = touchline("track", clip, out)
    assert code == 0
    counts, sentence = told.split()[:8], " ".join(told.split()[8:])
    assert counts == ["frames", "3", "tracked", "1", "bridged", "1", "lost", "1"]
    assert sentence == (
        "The clip shows a pitch of 101 x 68 m, not 105 x 68 m. The cameras lay the markings of 105 x "
        "68 m on its paint as well as they can; --pitch shown gives those of that pitch."
    )
    code, told, _ = touchline("track", clip, out, "--pitch", "shown")
    assert " ".join(told.split()).endswith("The cameras are those of that pitch.")


def test_the_pitch_that_is_shown_is_told_and_cameras_are_of_it_where_asked(
    found: list[FrameCamera], tmp_path: Path, touchline: Run
):
    clip, out = tmp_path / "clip.mp4", tmp_path / "out"
    clip.touch()
    code, told, _ = touchline("track", clip, out, "--pitch", "shown", "--json")
    result = json.loads(told)
    assert code == 0
    assert [row["outcome"] for row in result["frames"]] == ["bridged", "bridged", "lost"]
    pitch = result["pitch"]
    assert pitch["cameras"] == "shown" and pitch["frames"] == 24
    assert pitch["length"] == pytest.approx(101) and pitch["width"] == pytest.approx(68)
    assert pitch["crown"] == pytest.approx(0.16)
    assert pitch["tripod"] == pytest.approx([0.5, 66.0, -15.0])
    assert pitch["other"] == {"length": 101.0, "width": 68.0}
    sigma = pitch["sigma"]
    assert (sigma["length"], sigma["width"]) == pytest.approx((0.15, 0.05))
    assert sigma["tripod"] == pytest.approx(0.1)
    assert pitch_to_row(None, on_shown=True) is None


def test_cameras_of_the_far_side_are_turned_where_no_lines_say_it(
    found: list[FrameCamera], tmp_path: Path, touchline: Run
):
    clip, out = tmp_path / "clip.mp4", tmp_path / "out"
    clip.touch()
    assert touchline("track", clip, out, "--turn")[0] == 0
    x, y, z = CAMERA.position
    assert read_cameras(out, ReaderReport())["0"].position == pytest.approx([-x, -y, z])
    code, _, err = touchline("track", clip, out, "--turn", "--lines", "lines.json@0")
    assert code == 1 and "the given lines already say which half of the pitch is left" in err


@pytest.mark.parametrize(
    ("lines", "message"),
    [
        (["lines.json"], "does not name a line file and its frame"),
        (["lines.json@-1"], "does not name a line file and its frame"),
        (["@3"], "does not name a line file and its frame"),
        (["missing.json@3"], "missing.json cannot be read"),
        (["a.json@3", "b.json@03"], "frame 3 has two line files"),
    ],
)
def test_lines_that_name_no_file_or_frame_are_refused(
    lines: list[str], message: str, tmp_path: Path
):
    with pytest.raises(InputError, match=message):
        track_cameras_of_clip(tmp_path / "clip.mp4", tmp_path / "out", lines)


def test_the_worker_process_reads_clip_and_lines_and_says_what_is_wrong(
    tmp_path: Path, touchline: Run
):
    clip = write(tmp_path / "clip.avi", 480, 270)
    lines = tmp_path / "lines.json"
    lines.write_text(json.dumps({"Side line left": [{"x": 0.1, "y": 0.2}, {"x": 0.1, "y": 0.8}]}))
    code, _, err = touchline("track", clip, tmp_path / "out", "--lines", f"{lines}@0")
    assert code == 1 and "no camera can be computed from the lines of frame 0" in err
    clip.write_bytes(b"RIFF")
    code, _, err = touchline("track", clip, tmp_path / "out")
    assert code == 1 and "clip.avi is not a video that can be read" in err
    assert not (tmp_path / "out").exists()


def test_numbers_of_rows_are_counted():
    rows = [frame_to_row(frame(number, "tracked")) for number in range(2)]
    assert count_outcomes(rows) == {"frames": 2, "tracked": 2, "bridged": 0, "lost": 0}
