from __future__ import annotations

import struct
import threading
import zipfile
import zlib
from contextlib import nullcontext
from pathlib import Path
from typing import IO

import cv2
import numpy as np
import pytest

from app.errors import ImageError, NotFoundError, TooLargeError
from app.media import files as media_module
from app.media import video as video_index
from app.media.files import (
    decode_picture,
    describe_frame,
    guess_content_type,
    has_member,
    read_encoded_frame,
    read_media_size_and_crc,
)
from app.media.object_frames import ArchiveMemberReader
from app.soccer.group import Media

# Left half dark, right half bright: a flip is seen.
PICTURE = np.concatenate(
    [np.full((90, 80, 3), 20, np.uint8), np.full((90, 80, 3), 230, np.uint8)], axis=1
)
PNG = cv2.imencode(".png", PICTURE)[1].tobytes()


def decoded(data: bytes) -> np.ndarray:
    return cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR)


def bomb(width: int, height: int) -> bytes:
    """A whole PNG of few bytes that declares many pixels."""

    def chunk(kind: bytes, body: bytes) -> bytes:
        whole = kind + body
        return struct.pack(">I", len(body)) + whole + struct.pack(">I", zlib.crc32(whole))

    header = struct.pack(">IIBBBBB", width, height, 1, 0, 0, 0, 0)
    rows = zlib.compress(bytes((width // 8 + 2) * 16))
    return (
        b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", rows) + chunk(b"IEND", b"")
    )


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "7.png"
    path.write_bytes(PNG)
    return path


@pytest.fixture
def archive(tmp_path: Path) -> Path:
    path = tmp_path / "Frames-v3.zip"
    with zipfile.ZipFile(path, "w") as target:
        target.writestr("v3_frames/7.png", PNG)
    return path


def nested(tmp_path: Path, archive: Path, compression: int) -> Path:
    """An upload that holds the archive as a member."""
    path = tmp_path / "upload.zip"
    with zipfile.ZipFile(path, "w", compression) as target:
        target.write(archive, "league/Frames-v3.zip")
    return path


class TestFrameOfAZipInsideAZip:
    @pytest.mark.parametrize("compression", [zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED])
    def test_a_frame_is_read_inside_the_nested_zip(
        self, tmp_path, archive, settings, compression
    ) -> None:
        upload = nested(tmp_path, archive, compression)
        media = Media(str(upload), "league/Frames-v3.zip/v3_frames/7.png")
        assert read_encoded_frame(media, None, False, settings) == PNG
        assert read_encoded_frame(media, 40, True, settings) == read_encoded_frame(
            media, 40, True, settings
        )
        assert read_media_size_and_crc(media) == {"bytes": len(PNG), "crc32": zlib.crc32(PNG)}

    def test_real_bytes_are_counted(self, tmp_path, archive) -> None:
        upload = nested(tmp_path, archive, zipfile.ZIP_STORED)
        member = "league/Frames-v3.zip/v3_frames/7.png"
        with pytest.raises(TooLargeError):
            ArchiveMemberReader().read(upload, member, len(PNG) - 1)
        assert ArchiveMemberReader().read(upload, member, len(PNG)) == PNG

    def test_a_third_level_is_not_opened(self, tmp_path, archive) -> None:
        inner = nested(tmp_path, archive, zipfile.ZIP_STORED)
        outer = tmp_path / "outer.zip"
        with zipfile.ZipFile(outer, "w") as target:
            target.write(inner, "inner.zip")
        with pytest.raises(NotFoundError):
            ArchiveMemberReader().read(
                outer, "inner.zip/league/Frames-v3.zip/v3_frames/7.png", 10**6
            )

    def test_many_threads_read_one_archive_while_others_push_it_out(
        self, tmp_path, archive
    ) -> None:
        upload = nested(tmp_path, archive, zipfile.ZIP_DEFLATED)
        archives, got = ArchiveMemberReader(most=1), []

        def read() -> None:
            for _ in range(20):
                name = "league/Frames-v3.zip/v3_frames/7.png"
                got.append(archives.read(upload, name, 10**6) == PNG)

        threads = [threading.Thread(target=read) for _ in range(4)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        assert got == [True] * 80

    def test_one_that_is_pushed_out_before_its_member_is_opened_is_read(
        self, tmp_path, archive, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        other = tmp_path / "other.zip"
        with zipfile.ZipFile(other, "w") as target:
            target.writestr("1.png", PNG)
        archives, opened = ArchiveMemberReader(most=1), zipfile.ZipFile.open

        def late(self: zipfile.ZipFile, name: str) -> IO[bytes]:
            if name != "1.png":
                assert archives.read(other, "1.png", 10**6) == PNG
            return opened(self, name)

        monkeypatch.setattr(zipfile.ZipFile, "open", late)
        assert archives.read(archive, "v3_frames/7.png", 10**6) == PNG

    def test_a_damaged_nested_zip_is_named(self, tmp_path, archive) -> None:
        archive.write_bytes(archive.read_bytes()[:-30])
        upload = nested(tmp_path, archive, zipfile.ZIP_STORED)
        with pytest.raises(ImageError, match=r"upload\.zip/league/Frames-v3\.zip"):
            ArchiveMemberReader().read(upload, "league/Frames-v3.zip/7.png", 10**6)


class TestReadFrame:
    def test_a_file_comes_as_it_is(self, file, settings) -> None:
        data = read_encoded_frame(Media(str(file)), None, False, settings)
        assert data == PNG
        assert guess_content_type(data) == "image/png"

    def test_a_member_of_an_archive_is_read_in_place(self, archive, settings) -> None:
        media = Media(str(archive), "v3_frames/7.png")
        assert read_encoded_frame(media, None, False, settings) == PNG
        assert not settings.cache.exists()

    def test_is_made_small_and_cached(self, archive, settings) -> None:
        media = Media(str(archive), "v3_frames/7.png")
        data = read_encoded_frame(media, 40, False, settings)
        assert decoded(data).shape == (22, 40, 3)
        assert guess_content_type(data) == "image/jpeg"
        (cached,) = (path for path in settings.cache.rglob("*") if path.is_file())
        assert cached.read_bytes() == data
        cached.write_bytes(b"from the cache")
        assert read_encoded_frame(media, 40, False, settings) == b"from the cache"

    def test_another_file_in_its_place_is_another_picture(self, file, settings) -> None:
        first = read_encoded_frame(Media(str(file)), 40, False, settings)
        file.write_bytes(cv2.imencode(".png", 255 - PICTURE)[1].tobytes())
        assert read_encoded_frame(Media(str(file)), 40, False, settings) != first

    def test_a_frame_is_never_enlarged(self, file, settings) -> None:
        assert decoded(read_encoded_frame(Media(str(file)), 4000, False, settings)).shape == (
            90,
            160,
            3,
        )

    def test_a_mirrored_camera_is_turned_right(self, file, settings) -> None:
        plain = decoded(read_encoded_frame(Media(str(file)), 40, False, settings))
        turned = decoded(read_encoded_frame(Media(str(file)), 40, True, settings))
        assert plain[:, 5].mean() < 60 < 200 < turned[:, 5].mean()

    def test_a_full_disk_costs_the_cache_and_no_picture(self, file, settings) -> None:
        settings.home.mkdir()
        settings.cache.write_text("a file where the cache should be")
        assert decoded(read_encoded_frame(Media(str(file)), 40, False, settings)).shape[1] == 40

    def test_a_frame_of_a_video(self, tmp_path, settings) -> None:
        path = tmp_path / "cam1.avi"
        video = cv2.VideoWriter(str(path), cv2.VideoWriter_fourcc(*"MJPG"), 25, (160, 96))
        for level in (10, 90, 200):
            video.write(np.full((96, 160, 3), level, np.uint8))
        video.release()
        data = read_encoded_frame(Media(str(path), frame=2), None, False, settings)
        assert decoded(data).mean() == pytest.approx(200, abs=6)
        with pytest.raises(NotFoundError, match="no frame 7"):
            read_encoded_frame(Media(str(path), frame=7), None, False, settings)

    def test_a_video_of_too_many_pixels_is_refused(self, tmp_path, settings) -> None:
        path = tmp_path / "wide.mp4"
        writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"mp4v"), 25, (64, 48))
        writer.write(np.zeros((48, 64, 3), np.uint8))
        writer.release()
        small = settings.model_copy(update={"max_pixels": 64 * 48 - 1})
        with pytest.raises(TooLargeError, match=r"wide\.mp4 declares 64 x 48 pixels"):
            read_encoded_frame(Media(str(path), frame=0), None, False, small)

    def test_a_list_of_other_files_is_no_video(self, tmp_path, settings) -> None:
        hidden = tmp_path / "hidden.avi"
        video = cv2.VideoWriter(str(hidden), cv2.VideoWriter_fourcc(*"MJPG"), 25, (160, 96))
        for _ in range(3):
            video.write(np.full((96, 160, 3), 90, np.uint8))
        video.release()
        path = tmp_path / "cam1.mp4"
        path.write_text(f"ffconcat version 1.0\nfile {hidden.name}\n")
        with pytest.raises(ImageError, match=r"cam1\.mp4 is not a video that can be read"):
            read_encoded_frame(Media(str(path), frame=1), None, False, settings)

    def test_a_video_that_grows_on_its_way_is_refused(self, tmp_path, settings) -> None:
        class Growing:
            def isOpened(self) -> bool:
                return True

            def get(self, _: int) -> float:
                return 16.0

            def grab(self) -> bool:
                return True

            def retrieve(self) -> tuple[bool, np.ndarray]:
                return True, np.empty((8000, 8000, 3), np.uint8)

        path = tmp_path / "cam1.mp4"
        path.write_bytes(b"")
        with pytest.MonkeyPatch.context() as patch:
            for module in (media_module, video_index):
                patch.setattr(module, "open_video", lambda _: nullcontext(Growing()))
            patch.setattr(media_module, "read_video_times", lambda *_: np.arange(2.0))
            with pytest.raises(TooLargeError, match="8000 x 8000"):
                read_encoded_frame(Media(str(path), frame=1), None, False, settings)

    @pytest.mark.parametrize("width", [None, 40])
    def test_a_file_swapped_for_a_link_is_not_followed(self, tmp_path, settings, width) -> None:
        secret, path = tmp_path / "secret.png", tmp_path / "7.png"
        secret.write_bytes(PNG)
        path.symlink_to(secret)
        with pytest.raises(NotFoundError, match=r"7\.png is now a symbolic link"):
            read_encoded_frame(Media(str(path)), width, False, settings)

    def test_an_archive_swapped_for_a_link_is_not_followed(
        self, tmp_path, archive, settings
    ) -> None:
        path = tmp_path / "swapped.zip"
        path.symlink_to(archive)
        media = Media(str(path), "v3_frames/7.png")
        for asked in (
            lambda: read_encoded_frame(media, None, False, settings),
            lambda: read_encoded_frame(media, 40, False, settings),
            lambda: has_member(media, "v3_frames/7.png"),
        ):
            with pytest.raises(NotFoundError, match=r"swapped\.zip is now a symbolic link"):
                asked()
        assert read_media_size_and_crc(media) == {}

    def test_a_folder_swapped_for_a_link_does_not_lead_out(self, tmp_path, settings) -> None:
        outside, root = tmp_path / "outside", tmp_path / "root"
        outside.mkdir()
        root.mkdir()
        (outside / "7.png").write_bytes(PNG)
        (root / "match").symlink_to(outside)
        allowed = settings.model_copy(update={"import_folders": [root]})
        with pytest.raises(NotFoundError, match="leads out of its folder"):
            read_encoded_frame(Media(str(root / "match" / "7.png")), None, False, allowed)

    def test_a_root_that_is_a_link_itself_is_the_operators_own(self, tmp_path, settings) -> None:
        real, root = tmp_path / "real", tmp_path / "root"
        real.mkdir()
        (real / "7.png").write_bytes(PNG)
        root.symlink_to(real)
        allowed = settings.model_copy(update={"import_folders": [root]})
        assert read_encoded_frame(Media(str(root / "7.png")), None, False, allowed) == PNG

    @pytest.mark.parametrize("width", [None, 40])
    def test_a_bomb_is_refused_before_it_is_decoded(
        self, tmp_path, settings, monkeypatch, width
    ) -> None:
        path = tmp_path / "bomb.png"
        path.write_bytes(bomb(16_000, 16_000))
        monkeypatch.setattr(cv2, "imdecode", lambda *_: pytest.fail("decoded"))
        with pytest.raises(TooLargeError, match="16000 x 16000"):
            read_encoded_frame(Media(str(path)), width, False, settings)

    @pytest.mark.parametrize("width", [None, 40])
    def test_so_is_a_picture_that_is_drawn_over_and_over(
        self, tmp_path, settings, monkeypatch, width
    ) -> None:
        data = cv2.imencode(".jpg", PICTURE, [cv2.IMWRITE_JPEG_PROGRESSIVE, 1])[1].tobytes()
        path, last = tmp_path / "slow.jpg", data.rfind(b"\xff\xda")
        path.write_bytes(data[:last] + data[last:-2] * 100 + data[-2:])
        monkeypatch.setattr(cv2, "imdecode", lambda *_: pytest.fail("decoded"))
        with pytest.raises(
            TooLargeError, match=r"^frame slow\.jpg is drawn in more than 100 scans"
        ):
            read_encoded_frame(Media(str(path)), width, False, settings)

    @pytest.mark.parametrize("width", [None, 40])
    @pytest.mark.parametrize("data", [b"", b"hello", b"<svg/>", PNG[:60], b"\xff\xd8\xff\xe0" * 9])
    def test_a_file_that_is_no_image_is_refused(self, tmp_path, settings, data, width) -> None:
        path = tmp_path / "x.png"
        path.write_bytes(data)
        with pytest.raises(ImageError, match=r"^frame x\.png is "):
            read_encoded_frame(Media(str(path)), width, False, settings)

    @pytest.mark.parametrize("width", [None, 40])
    def test_a_member_that_is_no_image_is_named_with_its_archive(
        self, tmp_path, settings, width
    ) -> None:
        path = tmp_path / "Frames-v3.zip"
        with zipfile.ZipFile(path, "w") as target:
            target.writestr("7.png", b"GIF89a")
            target.writestr("8.png", bomb(16_000, 16_000))
            target.writestr("9.png", PNG[:-40])
        for member, error, what in (
            ("7.png", ImageError, "is not a JPEG, PNG or WebP image"),
            ("8.png", TooLargeError, "declares 16000 x 16000 pixels"),
            ("9.png", ImageError, "is damaged"),
        ):
            with pytest.raises(error, match=f"^frame {member} of Frames-v3.zip {what}"):
                read_encoded_frame(Media(str(path), member), width, False, settings)

    def test_a_file_beyond_the_limit_is_not_read(self, file, archive, settings) -> None:
        small = settings.model_copy(update={"max_file_bytes": 50})
        for media in (Media(str(file)), Media(str(archive), "v3_frames/7.png")):
            with pytest.raises(TooLargeError, match="larger than 50 bytes"):
                read_encoded_frame(media, None, False, small)

    @pytest.mark.parametrize("width", [None, 40])
    def test_a_missing_file_is_named_without_its_folder(
        self, tmp_path, archive, settings, width
    ) -> None:
        for media in (
            Media(str(tmp_path / "gone.png")),
            Media(str(tmp_path / "gone.zip"), "7.png"),
            Media(str(archive), "gone.png"),
            Media(str(tmp_path / "gone.mp4"), frame=3),
            Media(str(tmp_path)),
        ):
            with pytest.raises(NotFoundError) as caught:
                read_encoded_frame(media, width, False, settings)
            assert str(tmp_path) not in caught.value.message

    def test_a_truncated_archive_is_said(self, archive, settings) -> None:
        archive.write_bytes(archive.read_bytes()[:-30])
        with pytest.raises(ImageError, match="not a complete zip"):
            read_encoded_frame(Media(str(archive), "v3_frames/7.png"), None, False, settings)

    def test_a_damaged_member_is_said(self, archive, settings) -> None:
        data = bytearray(archive.read_bytes())
        data[80] ^= 0xFF
        archive.write_bytes(data)
        with pytest.raises(ImageError, match="cannot be read"):
            read_encoded_frame(Media(str(archive), "v3_frames/7.png"), None, False, settings)


class TestFrameName:
    def test_says_file_and_place_in_it_and_no_folder(self) -> None:
        assert describe_frame(Media("/data/7.png")) == "frame 7.png"
        assert (
            describe_frame(Media("/data/a.zip", "v3_frames/7.png"))
            == "frame v3_frames/7.png of a.zip"
        )
        assert describe_frame(Media("/data/cam1.mp4", frame=3)) == "frame 3 of cam1.mp4"


class TestMediaFacts:
    def test_an_archive_knows_size_and_checksum(self, file, archive) -> None:
        assert read_media_size_and_crc(Media(str(archive), "v3_frames/7.png")) == {
            "bytes": len(PNG),
            "crc32": zlib.crc32(PNG),
        }
        assert read_media_size_and_crc(Media(str(file))) == {"bytes": len(PNG)}

    def test_a_picture_of_its_own_is_read_for_its_checksum_and_a_video_is_not(self, file) -> None:
        read = {"bytes": len(PNG), "crc32": zlib.crc32(PNG)}
        assert read_media_size_and_crc(Media(str(file)), whole=True) == read
        film = Media(str(file), frame=3)
        assert read_media_size_and_crc(film, whole=True) == {"bytes": len(PNG)}

    def test_a_missing_file_has_no_facts(self, tmp_path, archive) -> None:
        assert read_media_size_and_crc(Media(str(tmp_path / "gone.png"))) == {}
        assert read_media_size_and_crc(Media(str(archive), "gone.png")) == {}


class TestArchives:
    def test_few_archives_stay_open_and_all_are_read(self, tmp_path) -> None:
        archives = ArchiveMemberReader(most=2)
        paths = []
        for number in range(5):
            path = tmp_path / f"{number}.zip"
            with zipfile.ZipFile(path, "w") as target:
                target.writestr("a", str(number))
            paths.append(path)
        for _ in range(2):
            read = [archives.read(path, "a", 10) for path in paths]
            assert read == [b"0", b"1", b"2", b"3", b"4"]
        assert len(archives._open) == 2
        archives.close()
        assert not archives._open

    def test_many_threads_read_at_once(self, tmp_path) -> None:
        path = tmp_path / "a.zip"
        bodies = {str(number): bytes([number]) * 50_000 for number in range(8)}
        with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as target:
            for name, body in bodies.items():
                target.writestr(name, body)
        archives, wrong = ArchiveMemberReader(), []

        def work() -> None:
            wrong.extend(
                name for name, body in bodies.items() if archives.read(path, name, 10**6) != body
            )

        threads = [threading.Thread(target=work) for _ in range(4)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        assert wrong == []
        archives.close()


def test_a_jpeg_that_is_cut_off_is_damaged_and_not_half_a_picture(settings) -> None:
    noise = np.random.default_rng(1).integers(0, 255, (90, 160, 3), np.uint8)
    whole = cv2.imencode(".jpg", noise)[1].tobytes()
    assert decode_picture(whole, settings, "7.jpg").shape == (90, 160, 3)
    with pytest.raises(ImageError, match="damaged"):
        decode_picture(whole[: len(whole) * 6 // 10], settings, "7.jpg")
