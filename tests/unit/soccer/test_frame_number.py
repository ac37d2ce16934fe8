from __future__ import annotations

import pytest

from app.soccer.group import Media, is_numbered_in_time, split_frame_number


class TestCountsTime:
    @pytest.mark.parametrize("name", ["7.png", "7_1.png"])
    def test_images_of_soccernet_are_other_actions(self, name: str) -> None:
        assert not is_numbered_in_time(
            Media(f"/frames/{name}"), f"league/season/match/{name}", False
        )

    def test_a_static_camera_counts_where_the_number_is_that_of_the_group(self) -> None:
        media = Media("/frames/cam3/000100.jpg")
        assert is_numbered_in_time(media, "clip/100", static=True)
        assert not is_numbered_in_time(media, "clip/358", static=True)
        assert not is_numbered_in_time(media, "clip/100", static=False)

    def test_a_clip_counts_in_a_folder_and_in_an_archive(self) -> None:
        assert is_numbered_in_time(Media("/SNGS-001/img1/000011.jpg"), "any", static=False)
        assert is_numbered_in_time(
            Media("/clip.zip", "SNGS-001/img1/000011.jpg"), "any", static=False
        )

    def test_a_video_counts(self) -> None:
        assert is_numbered_in_time(Media("/cam1.avi", None, 8), "any", static=False)

    def test_a_frame_of_an_object_store_has_no_neighbours(self) -> None:
        assert not is_numbered_in_time(Media("s3://frames/img1/000011.jpg"), "any", static=False)


class TestNumbered:
    def test_what_stands_before_the_number_is_kept(self) -> None:
        media = Media("/cam/frame_099.png")
        name, head, digits = split_frame_number(media, "99", static=True) or (None, "", "")
        assert (str(name), head, digits) == (media.path, "frame_", "099")

    def test_a_name_without_a_number_counts_nothing(self) -> None:
        assert split_frame_number(Media("/img1/first.png"), "1", static=True) is None
