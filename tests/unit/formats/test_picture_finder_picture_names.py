from __future__ import annotations

import unicodedata

import pytest

from app.formats.picture_finder import split_picture_name


class TestPictureParts:
    @pytest.mark.parametrize(
        ("name", "parts"),
        [
            ("a/b.jpg", "a/b.jpg"),
            ("images\\b.jpg", "images/b.jpg"),
            ("..\\..\\label-studio\\media\\upload\\4\\b.jpg", "label-studio/media/upload/4/b.jpg"),
            ("C:\\Users\\anna\\b.jpg", "Users/anna/b.jpg"),
            ("\\\\server\\share\\b.jpg", "server/share/b.jpg"),
            ("/home/anna/b.jpg", "home/anna/b.jpg"),
            ("./b.jpg", "b.jpg"),
            ("file:///home/anna/my%20frames/b.jpg", "home/anna/my frames/b.jpg"),
            ("file:///C:/frames/b.jpg", "frames/b.jpg"),
            ("https://host/data/b.jpg?token=1/2#x", "data/b.jpg"),
            ("s3://bucket/frames/b.jpg", "frames/b.jpg"),
            ("/data/local-files/?d=frames%2Fb.jpg", "frames/b.jpg"),
            ("/data/upload/4/1a2b3c4d-b.jpg", "data/upload/4/1a2b3c4d-b.jpg"),
            ("100%25.jpg", "100%25.jpg"),
            ("..", ""),
        ],
    )
    def test_the_parts_that_a_folder_here_can_have(self, name: str, parts: str) -> None:
        assert "/".join(split_picture_name(name)) == parts

    def test_decomposed_letters_are_composed(self) -> None:
        assert split_picture_name(unicodedata.normalize("NFD", "bälle/é.jpg")) == ("bälle", "é.jpg")
