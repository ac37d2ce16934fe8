"""One orientation everywhere: whatever decodes a picture has the pixels that people see of it."""

from __future__ import annotations

import io
import re
from collections.abc import Callable
from pathlib import Path
from tempfile import mkdtemp
from types import SimpleNamespace

import cv2
import numpy as np
import pytest
from PIL import Image, ImageOps

from app.config import Settings
from app.features.exports.source import ExportImageWriter
from app.features.file_tools.paint import read_pictures
from app.features.predictions.detect import _read_frame
from app.formats.report import ReaderReport
from app.media.files import (
    decode_frame,
    read_digest_and_pixels,
    read_encoded_frame,
    read_picture_header,
)
from app.media.frames import FrameProvider, make_picture
from app.soccer.frames import ImageSize
from app.soccer.group import Group, Media, Station, View

ORIENTATIONS = range(1, 9)
STORED = np.zeros((48, 80, 3), np.uint8)
STORED[:24, :24], STORED[24:, :24], STORED[:24, 56:] = (255, 0, 0), (0, 255, 0), (0, 0, 255)
"""Three corners of a colour each: every turn of it is another picture."""


def exif(orientation: int) -> bytes:
    block = Image.Exif()
    block[0x0112] = orientation
    return block.tobytes()


def write(path: Path, orientation: int) -> Path:
    options = {"quality": 95, "subsampling": 0} if path.suffix == ".jpg" else {}
    Image.fromarray(STORED).save(path, exif=exif(orientation), **options)
    return path


def plain(data: bytes) -> np.ndarray:
    """What a reader that ignores EXIF makes of a file."""
    flags = cv2.IMREAD_COLOR | cv2.IMREAD_IGNORE_ORIENTATION
    return cv2.imdecode(np.frombuffer(data, np.uint8), flags)[:, :, ::-1]


def exported(path: Path, images: str, settings: Settings) -> np.ndarray:
    height, width = STORED.shape[:2]
    station = Station("7", ImageSize(width, height))
    group = Group("m/7", (View("7", station, media=Media(str(path))),), "m")
    root = Path(mkdtemp(dir=path.parent))
    out = ExportImageWriter(
        root,
        images,
        lambda media, width, turn: make_picture(media, width, turn, settings),
    )
    out.add(group)
    assert out.missing == []
    return plain((root / out.placed["7"]).read_bytes())


def of_files(path: Path, settings: Settings) -> np.ndarray:
    """As commands read folders of pictures: paint, snap, agree and propose."""
    (found,) = read_pictures([path], settings, ReaderReport())
    assert found.image is not None
    return found.image


def served(path: Path, settings: Settings) -> np.ndarray:
    frames = FrameProvider(settings)
    try:
        return plain(frames.read(Media(str(path)), None, False).data)
    finally:
        frames.close()


USERS: dict[str, Callable[[Path, Settings], np.ndarray]] = {
    "the frame as it is": lambda path, to: plain(
        read_encoded_frame(Media(str(path)), None, False, to)
    ),
    "the frame made narrow": lambda path, to: plain(
        read_encoded_frame(Media(str(path)), 4000, False, to)
    ),
    "the same from the cache": lambda path, to: [
        plain(read_encoded_frame(Media(str(path)), 4000, False, to)) for _ in range(2)
    ][1],
    "a process of the server": served,
    "a mirrored camera": lambda path, to: np.fliplr(
        plain(read_encoded_frame(Media(str(path)), None, True, to))
    ),
    "paint of a view": lambda path, to: decode_frame(Media(str(path)), False, to),
    "paint of a dataset": lambda path, to: read_digest_and_pixels(Media(str(path)), False, to)[1],
    "pictures of a folder": of_files,
    "a detector": lambda path, to: _read_frame(
        SimpleNamespace(media=Media(str(path)), flipped=False), to
    )[:, :, ::-1],
    "an export that copies": lambda path, to: exported(path, "copy", to),
    "an export that links": lambda path, to: exported(path, "link", to),
}


@pytest.fixture
def settings(tmp_path: Path) -> Settings:
    return Settings(home=tmp_path / "home")


class TestOneOrientation:
    @pytest.mark.parametrize("suffix", [".jpg", ".png"])
    @pytest.mark.parametrize("user", USERS)
    def test_every_user_of_the_decoder_sees_what_people_see(
        self, user: str, suffix: str, tmp_path: Path, settings: Settings
    ) -> None:
        (tmp_path / "frames").mkdir()
        for orientation in ORIENTATIONS:
            path = write(tmp_path / "frames" / f"7{suffix}", orientation)
            with Image.open(path) as image:
                upright = np.asarray(ImageOps.exif_transpose(image).convert("RGB"))
            seen = USERS[user](path, settings)
            assert seen.shape == upright.shape, orientation
            assert np.abs(seen.astype(int) - upright).mean() < 6, orientation

    @pytest.mark.parametrize("suffix", [".jpg", ".png"])
    def test_the_header_has_the_size_that_is_seen(self, suffix: str, tmp_path: Path) -> None:
        sizes = []
        for orientation in ORIENTATIONS:
            header = read_picture_header(Media(str(write(tmp_path / f"7{suffix}", orientation))))
            assert header is not None and header.orientation == orientation
            sizes.append((header.width, header.height))
        assert sizes == [(80, 48)] * 4 + [(48, 80)] * 4

    def test_a_webp_is_shown_as_it_is_stored_as_browsers_do(
        self, tmp_path: Path, settings: Settings
    ) -> None:
        path = tmp_path / "7.webp"
        Image.fromarray(STORED).save(path, exif=exif(6), lossless=True)
        assert (decode_frame(Media(str(path)), False, settings) == STORED).all()
        assert read_encoded_frame(Media(str(path)), None, False, settings) == path.read_bytes()

    @pytest.mark.parametrize("orientation", [0, 9, 65535])
    def test_an_orientation_that_does_not_exist_turns_nothing(
        self, orientation: int, tmp_path: Path
    ) -> None:
        header = read_picture_header(Media(str(write(tmp_path / "7.jpg", orientation))))
        assert header is not None and (header.width, header.orientation) == (80, 1)

    @pytest.mark.filterwarnings("ignore:Corrupt EXIF data")
    def test_exif_that_is_cut_off_turns_nothing(self, tmp_path: Path, settings: Settings) -> None:
        for length in range(len(exif(6))):
            data = io.BytesIO()
            Image.fromarray(STORED).save(data, "JPEG", exif=exif(6)[:length])
            path = tmp_path / "7.jpg"
            path.write_bytes(data.getvalue())
            assert decode_frame(Media(str(path)), False, settings).shape in (
                (48, 80, 3),
                (80, 48, 3),
            )

    def test_what_was_read_of_stored_pixels_before_is_read_again(
        self, tmp_path: Path, settings: Settings
    ) -> None:
        path = write(tmp_path / "7.jpg", 6)
        digest, _ = read_digest_and_pixels(Media(str(path)), False, settings)
        assert read_digest_and_pixels(Media(str(path)), False, settings, digest) == (digest, None)
        write(tmp_path / "8.jpg", 1)
        upright, _ = read_digest_and_pixels(Media(str(tmp_path / "8.jpg")), False, settings)
        assert digest != upright

    def test_nothing_else_in_the_product_decodes_pictures(self) -> None:
        decoders = re.compile(r"cv2\.(imdecode|imread)|Image\.open\(")
        app = Path(__file__).parents[2] / "app"
        found = {
            str(path.relative_to(app))
            for path in app.rglob("*.py")
            if decoders.search(path.read_text())
        }
        assert found == {"media/files.py", "media/images.py"}
