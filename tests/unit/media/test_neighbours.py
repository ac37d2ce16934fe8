from __future__ import annotations

import zipfile
from pathlib import Path

import cv2
import numpy as np
import pytest

from app.media.neighbours import neighbouring_frames
from app.soccer.group import Media

PIXELS = np.full((64, 96, 3), 90, np.uint8)


def touch(folder: Path, *names: str) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    for name in names:
        (folder / name).write_bytes(b"picture")


class TestFiles:
    def test_frames_of_a_static_camera_are_found_by_their_number(self, tmp_path, settings) -> None:
        touch(tmp_path / "cam3", *(f"{number:06d}.jpg" for number in (92, 99, 100, 101, 104)))
        media = Media(str(tmp_path / "cam3" / "000100.jpg"))
        found = neighbouring_frames(media, "100", static=True, settings=settings)
        assert {offset: Path(item.path).name for offset, item in found.items()} == {
            -1: "000099.jpg",
            1: "000101.jpg",
            4: "000104.jpg",
        }

    def test_frame_numbers_may_gain_a_digit(self, tmp_path, settings) -> None:
        touch(tmp_path, "frame_99.png", "frame_100.png", "frame_101.png")
        found = neighbouring_frames(
            Media(str(tmp_path / "frame_100.png")), "100", static=True, settings=settings
        )
        assert sorted(found) == [-1, 1]

    def test_images_of_soccernet_are_other_actions(self, tmp_path, settings) -> None:
        touch(tmp_path, "6.png", "7.png", "8.png", "7_1.png", "7_2.png")
        for name in ("7.png", "7_1.png"):
            media = Media(str(tmp_path / name))
            assert (
                neighbouring_frames(
                    media, f"league/season/match/{name}", static=False, settings=settings
                )
                == {}
            )

    def test_images_that_are_numbered_in_no_order_have_none(self, tmp_path, settings) -> None:
        touch(tmp_path, "00041.jpg", "00042.jpg", "00043.jpg")
        media = Media(str(tmp_path / "00042.jpg"))
        assert neighbouring_frames(media, "00042.jpg", static=False, settings=settings) == {}
        # Nor those of a static camera whose number is not the frame's.
        assert neighbouring_frames(media, "358", static=True, settings=settings) == {}

    def test_frames_of_a_clip_have_their_neighbours(self, tmp_path, settings) -> None:
        touch(tmp_path / "SNGS-001" / "img1", "000010.jpg", "000011.jpg")
        media = Media(str(tmp_path / "SNGS-001" / "img1" / "000011.jpg"))
        assert sorted(
            neighbouring_frames(media, "SNGS-001/000011.jpg", static=False, settings=settings)
        ) == [-1]

    def test_a_link_is_not_followed_out_of_the_folder(self, tmp_path, settings) -> None:
        touch(tmp_path / "img1", "000010.jpg")
        touch(tmp_path, "secret.jpg")
        (tmp_path / "img1" / "000011.jpg").symlink_to(tmp_path / "secret.jpg")
        media = Media(str(tmp_path / "img1" / "000010.jpg"))
        assert neighbouring_frames(media, "10", static=False, settings=settings) == {}

    def test_members_of_an_archive_are_found_in_it(self, tmp_path, settings) -> None:
        path = tmp_path / "clip.zip"
        with zipfile.ZipFile(path, "w") as archive:
            for number in (5, 6, 7):
                archive.writestr(f"SNGS-001/img1/{number:06d}.jpg", b"picture")
        found = neighbouring_frames(
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
        assert neighbouring_frames(media, "1", static=False, settings=settings) == {}


class TestVideo:
    def test_frames_of_a_video_end_where_it_ends(self, tmp_path, settings) -> None:
        path = tmp_path / "cam1.avi"
        video = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"MJPG"), 25, (96, 64))
        for _ in range(10):
            video.write(PIXELS)
        video.release()
        assert sorted(
            neighbouring_frames(Media(str(path), None, 8), "8", static=True, settings=settings)
        ) == [
            *range(-5, 0),
            1,
        ]
        assert (
            sorted(
                neighbouring_frames(Media(str(path), None, 1), "1", static=True, settings=settings)
            )[0]
            == -1
        )
