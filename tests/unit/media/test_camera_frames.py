"""Frames of one camera by their numbers: as many are kept as fit."""

from __future__ import annotations

from pathlib import Path

import pytest

from app.config import Settings
from app.media import camera_frames
from app.media.camera_frames import CameraFrameReader
from app.soccer.group import Media
from tests.filmed_rigs import filmed_groups
from tests.flights import FIRST

COUNT, CAMERA = 8, "cam1"


@pytest.mark.parametrize("video", [False, True])
def test_large_frames_are_kept_by_twos_and_are_right_all_the_same(
    settings: Settings, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, video: bool
) -> None:
    (tmp_path / "film").mkdir()
    groups = filmed_groups(tmp_path / "film", COUNT, CAMERA, said=[], video=video)
    views = [group.view(CAMERA) for group in groups]
    media: dict[int, Media] = {
        FIRST + place: view.media for place, view in enumerate(views) if view and view.media
    }
    size = views[0].station.size
    usual = CameraFrameReader(media, False, size, settings)
    wanted = {number: usual.read(number) for number in media}
    monkeypatch.setattr(camera_frames, "KEPT_BYTES", 3 * size.width * size.height)
    reader = CameraFrameReader(media, False, size, settings)
    for number in [*media, *reversed(media)]:
        assert (reader.read(number) == wanted[number]).all()
        assert len(reader._kept) <= 2
    usual.close()
    reader.close()
