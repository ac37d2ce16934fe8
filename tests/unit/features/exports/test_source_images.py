"""Images of an export: linked where the file is the picture, copied where it is made."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from app.config import Settings
from app.features.exports.source import ExportImageWriter
from app.media.frames import make_picture
from app.soccer.frames import ImageSize
from app.soccer.group import Group, Media, Station, View


@pytest.fixture
def picture(tmp_path: Path) -> Path:
    path = tmp_path / "frames" / "7.png"
    path.parent.mkdir()
    half = np.zeros((40, 60, 3), np.uint8)
    half[:, 30:] = 200
    assert cv2.imwrite(str(path), half)
    return path


def placed(tmp_path: Path, picture: Path, flipped: bool) -> Path:
    settings = Settings(home=tmp_path / "home")
    station = Station("7.png", ImageSize(60, 40), flipped=flipped)
    group = Group("m/7.png", (View("7.png", station, media=Media(str(picture))),), "m")
    images = ExportImageWriter(
        tmp_path / "out",
        "link",
        lambda media, width, turn: make_picture(media, width, turn, settings),
    )
    images.add(group)
    assert images.missing == []
    return tmp_path / "out" / images.placed["7.png"]


def test_a_picture_that_is_its_file_is_linked(tmp_path: Path, picture: Path) -> None:
    target = placed(tmp_path, picture, flipped=False)
    assert target.is_symlink() and target.resolve() == picture


def test_a_mirrored_picture_is_turned_right_not_linked(tmp_path: Path, picture: Path) -> None:
    target = placed(tmp_path, picture, flipped=True)
    assert not target.is_symlink()
    seen = cv2.imread(str(target))
    assert seen[20, 10, 0] > 150 > seen[20, 50, 0]
