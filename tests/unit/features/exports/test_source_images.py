"""Images of an export: linked where the file is the picture, copied where it is made."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from app.config import Settings
from app.errors import OverloadedError
from app.features.exports.source import ExportImageWriter
from app.media.frames import EncodedPicture, make_picture
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


@pytest.mark.parametrize(("times", "calls"), [(1, 2), (9, 2)])
def test_a_picture_that_ends_its_process_is_tried_once_more_and_costs_itself_alone(
    tmp_path: Path, picture: Path, times: int, calls: int
) -> None:
    other = picture.with_name("8.png")
    other.write_bytes(picture.read_bytes())
    asked: list[str] = []

    def read(media: Media, width: int | None, turn: bool) -> EncodedPicture:
        if media.path == str(picture):
            asked.append(media.path)
            if len(asked) <= times:
                raise OverloadedError("frame 7.png was killed")
        return make_picture(media, width, turn, Settings(home=tmp_path / "home"))

    station = Station("7.png", ImageSize(60, 40))
    views = [View(path.name, station, media=Media(str(path))) for path in (picture, other)]
    images = ExportImageWriter(tmp_path / "out", "copy", read)
    images.add(Group("m/7.png", tuple(views), "m"))
    assert len(asked) == calls
    assert images.missing == ([] if times == 1 else ["m/7.png, 7.png: frame 7.png was killed"])
    assert "8.png" in images.placed
