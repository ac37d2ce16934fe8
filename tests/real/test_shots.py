"""Shots of real clips, alone and joined; skipped where they are not."""

from __future__ import annotations

import os
from pathlib import Path

import cv2
import pytest

from app.config import Settings
from app.video.indexing import index_recording
from app.video.shots import RecordingShots, find_shots
from tests.films import Clip, Join, join, write_film
from tests.videos import vary_times

DATA = Path(os.environ.get("TOUCHLINE_REAL_DATA", Path(__file__).parents[3] / "shared" / "data"))
BROADCAST, REPLAYS = DATA / "broadcast" / "clips", DATA / "replays"
SIZE = (640, 360)

pytestmark = pytest.mark.skipif(not BROADCAST.is_dir(), reason=f"no real clips in {DATA}")


def clip(path: Path, count: int) -> Clip:
    video, pictures = cv2.VideoCapture(str(path)), []
    while len(pictures) < count and video.grab():
        pictures.append(cv2.resize(video.retrieve()[1], SIZE, interpolation=cv2.INTER_AREA))
    video.release()
    return pictures


def shots_of(path: Path) -> RecordingShots:
    return find_shots(index_recording(path, Settings()))


@pytest.mark.parametrize("name", ["ang_psg", "avl_liv", "dfl", "liv_ben", "rma_sev"])
def test_a_clip_of_one_camera_is_one_shot(name: str) -> None:
    assert len(shots_of(BROADCAST / f"{name}.mp4").shots) == 1


def test_real_clips_are_parted_at_their_cuts_at_a_variable_rate_too(tmp_path: Path) -> None:
    paths = [*sorted(BROADCAST.glob("*.mp4")), *sorted(REPLAYS.glob("*_clip_0.mp4"))]
    clips = [clip(path, 40 + 7 * at) for at, path in enumerate(paths)]
    film, known = join(clips, [Join("cut")] * (len(clips) - 1))
    path = write_film(tmp_path / "film.mp4", film)
    wanted = [shot.first for shot in known]
    assert [shot.first for shot in shots_of(path).shots] == wanted
    vary_times(path, [256 + 512 * (number % 3) for number in range(len(film))])
    assert [shot.first for shot in shots_of(path).shots] == wanted


def test_dissolves_between_real_main_cameras_are_within_two_frames(tmp_path: Path) -> None:
    clips = [clip(path, 75) for path in sorted(BROADCAST.glob("*.mp4"))]
    joins = [Join("dissolve", length) for length in (8, 12, 18, 24)]
    film, known = join(clips, joins)
    found = shots_of(write_film(tmp_path / "film.mp4", film)).shots
    assert [shot.entered_by for shot in found] == [shot.entered_by for shot in known]
    for shot, wanted in zip(found, known, strict=True):
        assert abs(shot.first - wanted.first) <= 2 and abs(shot.last - wanted.last) <= 2


@pytest.mark.skipif(not REPLAYS.is_dir(), reason=f"no replays in {DATA}")
def test_a_real_logo_and_real_dissolves_are_found() -> None:
    """Seen by eye: a football flies over frames 29 to 39, 110 and 111 are mixed; 44 and 45 are."""
    found = shots_of(REPLAYS / "action_1_clip_1.mp4").shots
    assert [shot.entered_by for shot in found] == ["start", "wipe", "dissolve"]
    for shot, first in zip(found, (0, 40, 112), strict=True):
        assert abs(shot.first - first) <= 2
    other = shots_of(REPLAYS / "action_1_clip_2.mp4").shots
    assert other[1].entered_by == "dissolve" and abs(other[1].first - 46) <= 2
