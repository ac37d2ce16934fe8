"""Pictures are made in other processes, and what is too much for one is refused."""

from __future__ import annotations

import os
import signal
import struct
import zipfile
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
from app.media.frames import FrameProvider, find_neighbouring_frames, make_picture
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
def frames(settings: Settings) -> Iterator[FrameProvider]:
    made = FrameProvider(settings)
    yield made
    made.close()


@pytest.fixture
def media(tmp_path: Path) -> Media:
    path = tmp_path / "7.png"
    path.write_bytes(PNG)
    return Media(str(path))


class TestFrames:
    def test_makes_the_same_picture_as_this_process(
        self, frames: FrameProvider, media: Media, settings: Settings
    ) -> None:
        for width in (None, 40):
            assert frames.read(media, width, False) == make_picture(media, width, False, settings)

    def test_a_picture_that_was_made_needs_no_process(
        self,
        frames: FrameProvider,
        media: Media,
        settings: Settings,
        monkeypatch: pytest.MonkeyPatch,
    ) -> None:
        assert frames.read_cached(media, 40, False) is None
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
        frames = FrameProvider(settings)
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
        frames = FrameProvider(settings)
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
        frames: FrameProvider,
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
        self, frames: FrameProvider, media: Media, monkeypatch: pytest.MonkeyPatch
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
        self, frames: FrameProvider, media: Media, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr(module, "make_picture", note_and_run_out_of_time)
        for task in [frames.request_picture(media, width, False) for width in (None, 40, 80)]:
            with pytest.raises(TooLargeError, match="takes more than 10 seconds"):
                task.future.result()
        assert Path(f"{media.path}.tries").read_text() == "None\n"

    def test_what_is_silent_is_tried_again_after_a_while(
        self, frames: FrameProvider, media: Media, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        with monkeypatch.context() as patch:
            patch.setattr(module, "make_picture", sleep_on)
            patch.setattr(frames._pool._workers[0], "limits", WorkerLimits(2**30, 10.0, 0.01))
            with pytest.raises(TooLargeError, match="no result or progress"):
                frames.read(media, None, False)
        with pytest.raises(TooLargeError, match="no result or progress"):
            frames.read(media, 40, False)
        later = monotonic() + module.REMEMBERED_SECONDS["silence"]
        monkeypatch.setattr(module, "monotonic", lambda: later)
        assert frames.read(media, 40, False).kind == "image/jpeg"

    def test_a_refusal_is_that_of_this_process(self, frames: FrameProvider, tmp_path: Path) -> None:
        with pytest.raises(NotFoundError, match=r"gone\.png is no longer in the place"):
            frames.read(Media(str(tmp_path / "gone.png")), None, False)
        path = tmp_path / "x.png"
        path.write_bytes(b"hello")
        with pytest.raises(ImageError, match=r"frame x\.png is not a JPEG, PNG or WebP image"):
            frames.read(Media(str(path)), None, False)

    def test_the_frames_around_one_are_found(self, frames: FrameProvider, tmp_path: Path) -> None:
        folder = tmp_path / "img1"
        folder.mkdir()
        for number in (1, 2, 3):
            (folder / f"00000{number}.png").write_bytes(PNG)
        task = frames.request_neighbours(Media(str(folder / "000002.png")), "2", False)
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


PIXELS = np.full((64, 96, 3), 90, np.uint8)


def touch(folder: Path, *names: str) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    for name in names:
        (folder / name).write_bytes(b"picture")


class TestFiles:
    def test_frames_of_a_static_camera_are_found_by_their_number(self, tmp_path, settings) -> None:
        touch(tmp_path / "cam3", *(f"{number:06d}.jpg" for number in (92, 99, 100, 101, 104)))
        media = Media(str(tmp_path / "cam3" / "000100.jpg"))
        found = find_neighbouring_frames(media, "100", static=True, settings=settings)
        assert {offset: Path(item.path).name for offset, item in found.items()} == {
            -1: "000099.jpg",
            1: "000101.jpg",
            4: "000104.jpg",
        }

    def test_frame_numbers_may_gain_a_digit(self, tmp_path, settings) -> None:
        touch(tmp_path, "frame_99.png", "frame_100.png", "frame_101.png")
        found = find_neighbouring_frames(
            Media(str(tmp_path / "frame_100.png")), "100", static=True, settings=settings
        )
        assert sorted(found) == [-1, 1]

    def test_images_of_soccernet_are_other_actions(self, tmp_path, settings) -> None:
        touch(tmp_path, "6.png", "7.png", "8.png", "7_1.png", "7_2.png")
        for name in ("7.png", "7_1.png"):
            media = Media(str(tmp_path / name))
            assert (
                find_neighbouring_frames(
                    media, f"league/season/match/{name}", static=False, settings=settings
                )
                == {}
            )

    def test_images_that_are_numbered_in_no_order_have_none(self, tmp_path, settings) -> None:
        touch(tmp_path, "00041.jpg", "00042.jpg", "00043.jpg")
        media = Media(str(tmp_path / "00042.jpg"))
        assert find_neighbouring_frames(media, "00042.jpg", static=False, settings=settings) == {}
        # Nor those of a static camera whose number is not the frame's.
        assert find_neighbouring_frames(media, "358", static=True, settings=settings) == {}

    def test_frames_of_a_clip_have_their_neighbours(self, tmp_path, settings) -> None:
        touch(tmp_path / "SNGS-001" / "img1", "000010.jpg", "000011.jpg")
        media = Media(str(tmp_path / "SNGS-001" / "img1" / "000011.jpg"))
        assert sorted(
            find_neighbouring_frames(media, "SNGS-001/000011.jpg", static=False, settings=settings)
        ) == [-1]

    def test_a_link_is_not_followed_out_of_the_folder(self, tmp_path, settings) -> None:
        touch(tmp_path / "img1", "000010.jpg")
        touch(tmp_path, "secret.jpg")
        (tmp_path / "img1" / "000011.jpg").symlink_to(tmp_path / "secret.jpg")
        media = Media(str(tmp_path / "img1" / "000010.jpg"))
        assert find_neighbouring_frames(media, "10", static=False, settings=settings) == {}

    def test_members_of_an_archive_are_found_in_it(self, tmp_path, settings) -> None:
        path = tmp_path / "clip.zip"
        with zipfile.ZipFile(path, "w") as archive:
            for number in (5, 6, 7):
                archive.writestr(f"SNGS-001/img1/{number:06d}.jpg", b"picture")
        found = find_neighbouring_frames(
            Media(str(path), "SNGS-001/img1/000006.jpg"), "6", static=False, settings=settings
        )
        assert {offset: item.member for offset, item in found.items()} == {
            -1: "SNGS-001/img1/000005.jpg",
            1: "SNGS-001/img1/000007.jpg",
        }

    @pytest.mark.parametrize(
        "media", [Media("/nowhere/img1/000001.jpg"), Media("/no.avi", None, 4)]
    )
    def test_where_the_files_are_gone_there_are_none(self, media, settings) -> None:
        assert find_neighbouring_frames(media, "1", static=False, settings=settings) == {}


class TestVideo:
    def test_frames_of_a_video_end_where_it_ends(self, tmp_path, settings) -> None:
        path = tmp_path / "cam1.avi"
        video = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"MJPG"), 25, (96, 64))
        for _ in range(10):
            video.write(PIXELS)
        video.release()
        assert sorted(
            find_neighbouring_frames(Media(str(path), None, 8), "8", static=True, settings=settings)
        ) == [
            *range(-5, 0),
            1,
        ]
        assert (
            sorted(
                find_neighbouring_frames(
                    Media(str(path), None, 1), "1", static=True, settings=settings
                )
            )[0]
            == -1
        )
