from __future__ import annotations

import io
import random
import tempfile
import zipfile
from pathlib import Path

import pytest

from app.errors import UnsafePathError
from app.formats.output import write_zip
from app.formats.view_files import HELD, FilesToPack, ViewFileBuffer, make_disk_writer, open_spill


class TestSpill:
    def test_gives_thousands_of_items_back_by_key_and_equal_ones_as_they_came(self) -> None:
        keys = [(n % 3, n % 2, str(n % 5), -n // 7) for n in range(5000)]
        random.Random(3).shuffle(keys)
        with open_spill() as spill:
            for number, key in enumerate(keys):
                spill.add(key, str(number))
            found = list(spill.items())
        expected = sorted(((key, str(n)) for n, key in enumerate(keys)), key=lambda item: item[0])
        assert found == expected

    def test_leaves_no_file(self, tmp_path: Path) -> None:
        tempfile.tempdir, before = str(tmp_path), tempfile.tempdir
        try:
            with open_spill() as spill:
                spill.add((1, 2, "", 3), "x")
                assert list(tmp_path.rglob("spill.db"))
        finally:
            tempfile.tempdir = before
        assert list(tmp_path.iterdir()) == []


class TestViewFiles:
    def test_come_back_among_the_files_of_the_disk_in_the_order_of_their_paths(self, tmp_path):
        (tmp_path / "b").mkdir()
        (tmp_path / "b" / "2.csv").write_text("on disk")
        with ViewFileBuffer(tmp_path) as files:
            files.write_file("b/3.json", "ü")
            files.write_file("b/1.json", "{}")
            files.write_file("a.json", "")
        assert list(FilesToPack(tmp_path)) == [
            ("a.json", b""),
            ("b/1.json", b"{}"),
            ("b/2.csv", tmp_path / "b" / "2.csv"),
            ("b/3.json", "ü".encode()),
        ]

    def test_what_is_put_again_is_the_newer_file(self, tmp_path):
        with ViewFileBuffer(tmp_path) as files:
            files.write_file("a", "first")
            files.write_file("./a", "then")
        assert list(FilesToPack(tmp_path)) == [("a", b"then")]

    def test_a_zip_of_them_is_that_of_files_on_the_disk_to_the_byte(self, tmp_path):
        texts = {f"{match}/camera_{view}.json": f"{match} {view}" * view for match in "ba" for view in range(40)}  # fmt: skip
        (tmp_path / "disk").mkdir()
        (tmp_path / "held").mkdir()
        with ViewFileBuffer(tmp_path / "held") as files:
            for put in (make_disk_writer(tmp_path / "disk"), files.write_file):
                for path, text in texts.items():
                    put(path, text)
        made = []
        for folder in ("disk", "held"):
            (tmp_path / folder / "manifest.json").write_text("{}")
            made.append(io.BytesIO())
            write_zip(tmp_path / folder, made[-1])
        assert made[0].getvalue() == made[1].getvalue()
        assert HELD not in zipfile.ZipFile(made[1]).namelist()

    def test_a_disk_that_is_full_is_told_as_it_is_of_a_file(self, tmp_path):
        files = ViewFileBuffer(tmp_path)
        # What SQLite is told of a disk without room.
        files._connection.execute("PRAGMA max_page_count = 3")
        with pytest.raises(OSError, match="full"), files:
            for number in range(5000):
                files.write_file(f"{number}.json", "x" * 100)

    @pytest.mark.parametrize("path", ["../out", "/etc/passwd", "a/../../b", ""])
    def test_no_path_leaves_the_folder(self, tmp_path, path):
        with ViewFileBuffer(tmp_path) as files:
            for put in (files.write_file, make_disk_writer(tmp_path)):
                with pytest.raises(UnsafePathError):
                    put(path, "x")
