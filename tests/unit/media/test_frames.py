"""Pictures are made in other processes, and what is too much for one is refused."""

from __future__ import annotations

import os
import signal
import struct
import zlib
from collections.abc import Iterator
from pathlib import Path
from time import monotonic, sleep
from typing import Any

import cv2
import numpy as np
import pytest

from app.config import Settings
from app.errors import ImageError, NotFoundError, OverloadedError, TooLargeError
from app.media import frames as module
from app.media.frames import Frames, make_picture
from app.soccer.group import Media
from app.worker_process import WorkerLimits

PICTURE = np.full((90, 160, 3), 90, np.uint8)
PNG = cv2.imencode(".png", PICTURE)[1].tobytes()
LITTLE = WorkerLimits(450 * 2**20, 60.0, 60.0)
"""Above what a process holds that has loaded the libraries, some 300 MiB, and below a deep picture besides."""


def deep_png(side: int) -> bytes:
    """A black PNG with 16 bits a channel: a few hundred times smaller than its pixels."""

    def chunk(kind: bytes, body: bytes) -> bytes:
        whole = kind + body
        return struct.pack(">I", len(body)) + whole + struct.pack(">I", zlib.crc32(whole))

    packer, row = zlib.compressobj(9), bytes(side * 6 + 1)
    data = b"".join(packer.compress(row) for _ in range(side)) + packer.flush()
    header = struct.pack(">IIBBBBB", side, side, 16, 2, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + b"".join(
        (chunk(b"IHDR", header), chunk(b"IDAT", data), chunk(b"IEND", b""))
    )


@pytest.fixture
def settings(tmp_path: Path) -> Settings:
    return Settings(home=tmp_path / "home", image_workers=1)


@pytest.fixture
def frames(settings: Settings) -> Iterator[Frames]:
    made = Frames(settings)
    yield made
    made.close()


@pytest.fixture
def media(tmp_path: Path) -> Media:
    path = tmp_path / "7.png"
    path.write_bytes(PNG)
    return Media(str(path))


class TestFrames:
    def test_makes_the_same_picture_as_this_process(
        self, frames: Frames, media: Media, settings: Settings
    ) -> None:
        for width in (None, 40):
            assert frames.read(media, width, False) == make_picture(media, width, False, settings)

    def test_a_picture_that_was_made_needs_no_process(
        self, frames: Frames, media: Media, settings: Settings, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        assert frames.cached(media, 40, False) is None
        made = make_picture(media, 40, False, settings)
        monkeypatch.setattr(frames._pool, "submit", lambda *_, **__: pytest.fail("asked"))
        assert frames.read(media, 40, False) == made

    def test_what_needs_too_much_is_refused_by_its_name_and_not_tried_again(
        self,
        tmp_path: Path,
        settings: Settings,
        media: Media,
        monkeypatch: pytest.MonkeyPatch,
    ) -> None:
        path = tmp_path / "deep.png"
        path.write_bytes(deep_png(7000))
        monkeypatch.setattr(module, "LIMITS", LITTLE)
        frames = Frames(settings)
        try:
            frames.read(media, None, False)
            with pytest.raises(TooLargeError, match=r"^frame deep\.png needs more than 450 MiB"):
                frames.read(Media(str(path)), None, False)
            assert frames.read(media, None, False).data == PNG
        finally:
            frames.close()

    def test_a_decoder_that_takes_want_of_memory_for_damage_is_not_believed(
        self, tmp_path: Path, settings: Settings, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr(module, "LIMITS", LITTLE)
        monkeypatch.setattr(module, "make_picture", decode_nothing)
        frames = Frames(settings)
        try:
            for side, error, reason in (
                (7000, TooLargeError, "needs more than 450 MiB"),
                (70, ImageError, "is damaged"),
            ):
                path = tmp_path / f"{side}.png"
                path.write_bytes(deep_png(side))
                with pytest.raises(error, match=reason):
                    frames.read(Media(str(path)), 40, False)
        finally:
            frames.close()

    @pytest.mark.parametrize(
        ("end", "error", "reason"),
        [
            ("crash", ImageError, "made its process crash"),
            ("be_killed", OverloadedError, "killed"),
            ("be_told_to_end", OverloadedError, "was stopped"),
        ],
    )
    def test_what_may_be_the_machines_doing_is_tried_again(
        self,
        frames: Frames,
        media: Media,
        monkeypatch: pytest.MonkeyPatch,
        end: str,
        error: type[Exception],
        reason: str,
    ) -> None:
        with monkeypatch.context() as patch:
            patch.setattr(module, "make_picture", globals()[end])
            with pytest.raises(error, match=rf"frame 7\.png .*{reason}"):
                frames.read(media, None, False)
        assert frames.read(media, None, False).kind == "image/png"

    def test_what_takes_too_long_is_not_tried_again_before_it_changes(
        self, frames: Frames, media: Media, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        with monkeypatch.context() as patch:
            patch.setattr(module, "make_picture", run_out_of_time)
            with pytest.raises(TooLargeError, match=r"frame 7\.png takes more than 10 seconds"):
                frames.read(media, None, False)
        for width in (None, 40):
            with pytest.raises(TooLargeError, match="takes more than"):
                frames.read(media, width, False)
        Path(media.path).write_bytes(PNG + b"\0")
        assert frames.read(media, None, False).kind == "image/png"

    def test_another_width_that_waited_meanwhile_is_not_tried_either(
        self, frames: Frames, media: Media, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr(module, "make_picture", note_and_run_out_of_time)
        for task in [frames.ask(media, width, False) for width in (None, 40, 80)]:
            with pytest.raises(TooLargeError, match="takes more than 10 seconds"):
                task.future.result()
        assert Path(f"{media.path}.tries").read_text() == "None\n"

    def test_what_is_silent_is_tried_again_after_a_while(
        self, frames: Frames, media: Media, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        with monkeypatch.context() as patch:
            patch.setattr(module, "make_picture", sleep_on)
            patch.setattr(frames._pool._workers[0], "limits", WorkerLimits(2**30, 10.0, 0.01))
            with pytest.raises(TooLargeError, match="without a result"):
                frames.read(media, None, False)
        with pytest.raises(TooLargeError, match="without a result"):
            frames.read(media, 40, False)
        later = monotonic() + module.REMEMBERED_SECONDS["silence"]
        monkeypatch.setattr(module, "monotonic", lambda: later)
        assert frames.read(media, 40, False).kind == "image/jpeg"

    def test_a_refusal_is_that_of_this_process(self, frames: Frames, tmp_path: Path) -> None:
        with pytest.raises(NotFoundError, match=r"gone\.png is not where it was imported from"):
            frames.read(Media(str(tmp_path / "gone.png")), None, False)
        path = tmp_path / "x.png"
        path.write_bytes(b"hello")
        with pytest.raises(ImageError, match=r"frame x\.png is no JPEG, PNG or WebP image"):
            frames.read(Media(str(path)), None, False)

    def test_the_frames_around_one_are_found(self, frames: Frames, tmp_path: Path) -> None:
        folder = tmp_path / "img1"
        folder.mkdir()
        for number in (1, 2, 3):
            (folder / f"00000{number}.png").write_bytes(PNG)
        task = frames.ask_neighbours(Media(str(folder / "000002.png")), "2", False)
        assert sorted(task.future.result()) == [-1, 1]


def crash(*_: object) -> None:
    os.abort()


def be_told_to_end(*_: object) -> None:
    os.kill(os.getpid(), signal.SIGTERM)


def be_killed(*_: object) -> None:
    os.kill(os.getpid(), signal.SIGKILL)


def decode_nothing(*arguments: Any) -> Any:
    """Make a picture with a decoder that says nothing of why it cannot."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(cv2, "imdecode", lambda *_: None)
        return make_picture(*arguments)


def run_out_of_time(*_: object) -> None:
    os.kill(os.getpid(), signal.SIGXCPU)


def note_and_run_out_of_time(media: Media, width: int | None, *_: object) -> None:
    with Path(f"{media.path}.tries").open("a") as file:
        file.write(f"{width}\n")
    run_out_of_time()


def sleep_on(*_: object) -> None:
    sleep(600)
