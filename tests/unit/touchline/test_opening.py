"""Versions opened from folders and zips: the right ones, and those that are refused."""

from __future__ import annotations

import json
import shutil
import unicodedata
import zipfile
import zlib
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image
from PIL.PngImagePlugin import PngInfo

import touchline
from app.formats.export_record import ExportRecord
from app.media.images import read_header
from tests.unit.touchline.conftest import HASH, Answers, write_export, zipped
from touchline.client import Client
from touchline.errors import DataError, HashError
from touchline.frames import FileFrames, ServerFrames


@pytest.fixture
def copy(export: Path, tmp_path: Path) -> Path:
    """An export to spoil."""
    return Path(shutil.copytree(export, tmp_path / "copy"))


def _remove_utf_8_mark(path: Path) -> None:
    """Take the mark for UTF-8 off the names of a zip, as many programs write them."""
    content = bytearray(path.read_bytes())
    for signature, at in ((b"PK\x03\x04", 6), (b"PK\x01\x02", 8)):
        content[content.index(signature) + at + 1] &= ~0x08
    path.write_bytes(content)


class TestOpen:
    @pytest.mark.parametrize("version", [None, "v1", HASH, HASH[:8]])
    def test_a_folder_and_its_zip_are_the_same_version(
        self, export: Path, tmp_path: Path, version: str | None
    ) -> None:
        folder = touchline.open(export, version)
        packed = touchline.open(zipped(export, tmp_path / "v1.zip"), version)
        assert folder.groups == packed.groups
        assert (folder.name, folder.version, folder.hash) == ("league", "v1", HASH)
        assert (packed.views[1].image() == folder.views[1].image()).all()

    @pytest.mark.parametrize("version", ["v2", "0" * 16, HASH[:7]])
    def test_another_version_than_was_asked_for_is_refused(
        self, export: Path, version: str
    ) -> None:
        with pytest.raises(HashError, match=f"--version {version} --format parquet"):
            touchline.open(export, version)

    def test_a_table_that_was_changed_is_refused(self, copy: Path) -> None:
        table = copy / "views.parquet"
        content = bytearray(table.read_bytes())
        content[len(content) // 2] ^= 1
        table.write_bytes(content)
        with pytest.raises(HashError, match=r"Delete .* and export"):
            touchline.open(copy)

    def test_a_frame_that_was_changed_is_refused_when_it_is_read(self, copy: Path) -> None:
        view = touchline.open(copy).views[0]
        (copy / view.file_name).write_bytes(b"another picture")
        with pytest.raises(HashError, match="is not what its manifest says"):
            view.image()

    def test_what_is_no_export_is_refused(self, copy: Path, tmp_path: Path) -> None:
        (other := tmp_path / "thesis.txt").write_text("years of work")
        for path in (tmp_path / "nothing", tmp_path, other):
            with pytest.raises(DataError):
                touchline.open(path)
        manifest = json.loads((copy / "manifest.json").read_text())
        manifest["files"] = [item for item in manifest["files"] if "parquet" not in item["path"]]
        (copy / "manifest.json").write_text(json.dumps(manifest | {"format": "yolo"}))
        with pytest.raises(DataError, match=r"another format \(yolo\)"):
            touchline.open(copy)


class TestFrames:
    def test_without_frames_one_is_told_how_to_give_them(
        self, records: list[ExportRecord], tmp_path: Path
    ) -> None:
        bare = touchline.open(write_export(tmp_path / "bare", records, images=False))
        with pytest.raises(DataError, match="frames="):
            bare.views[0].image()

    def test_they_are_found_under_soccernets_names_too(
        self, records: list[ExportRecord], export: Path, tmp_path: Path
    ) -> None:
        bare = write_export(tmp_path / "bare", records, images=False)
        wanted = touchline.open(export).views
        for record in records:
            folder = tmp_path / "frames" / record.group.match
            folder.mkdir(parents=True, exist_ok=True)
            with zipfile.ZipFile(folder / "Frames-v3.zip", "a") as archive:
                for view in record.group.views:
                    content = next(
                        item.frame()
                        for item in wanted
                        if (item.group, item.key) == (record.group.key, view.key)
                    )
                    archive.writestr(f"v3_frames/{view.key}", content)
        for frames in (tmp_path / "frames", export):
            found = touchline.open(bare, frames=frames).views
            assert [view.frame() for view in found] == [view.frame() for view in wanted]
        (tmp_path / "empty").mkdir()
        with pytest.raises(DataError, match="has no frame"):
            touchline.open(bare, frames=tmp_path / "empty").views[0].frame()

    @pytest.mark.parametrize("form", ["NFC", "NFD"])
    @pytest.mark.parametrize("kind", ["folder", "archive", "zip", "unmarked zip", "windows zip"])
    def test_they_are_found_however_their_names_are_written(
        self, export: Path, tmp_path: Path, form: Any, kind: str
    ) -> None:
        other = {"NFC": "NFD", "NFD": "NFC"}[form]
        names = [
            unicodedata.normalize(
                one, "liga/2030/K\u00f6ln 1 - 0 Ly\u00f3n/Frames-v3/caf\u00e9.png"
            )
            for one in (form, other)
        ]
        view = replace(touchline.open(export).views[0], file_name=names[0])
        place = tmp_path / "frames"
        if kind == "folder":
            (place / names[1]).parent.mkdir(parents=True)
            (place / names[1]).write_bytes(b"x")
        elif kind == "archive":
            match, _, image = names[1].partition("/Frames-v3/")
            (place / match).mkdir(parents=True)
            with zipfile.ZipFile(place / match / "Frames-v3.zip", "w") as archive:
                archive.writestr(image, b"x")
        else:
            stored = names[1].replace("/", "\\") if kind == "windows zip" else names[1]
            with zipfile.ZipFile(place, "w") as archive:
                archive.writestr(stored, b"x")
            if kind == "unmarked zip":
                _remove_utf_8_mark(place)
        assert FileFrames(place).read(view) == b"x"

    @pytest.mark.parametrize("as_stored", ["true", None])
    @pytest.mark.parametrize(
        ("known", "same"),
        [
            ({}, True), ({"bytes": 9, "crc32": zlib.crc32(b'"picture"')}, True),
            ({"bytes": 8}, False), ({"bytes": 9, "crc32": 5}, False),
        ],
    )  # fmt: skip
    def test_a_server_that_has_another_file_by_now_is_not_believed(
        self,
        export: Path,
        answers: Answers,
        known: dict[str, int],
        same: bool,
        as_stored: str | None,
    ) -> None:
        view = touchline.open(export).views[0]
        answers.say(200, {"items": [{"key": view.group, "id": 1}], "next": None})
        answers.say(200, {"views": [{"key": view.key, "image": "/api/v1/views/1/image"}]})
        answers.say(
            200, "picture", **({} if as_stored is None else {"Touchline_As_Stored": as_stored})
        )
        media = [{"group": view.group, "view": view.key, **known}]
        frames = ServerFrames(Client(answers.address), "league", {"media": media})
        # What the server made of a file, or an older one sends, is not the file.
        if same or as_stored is None:
            assert frames.read(view) == b'"picture"'
        else:
            with pytest.raises(HashError, match="is not the one that was exported"):
                frames.read(view)

    def test_a_file_that_would_be_the_frame_of_two_views_is_refused(
        self, records: list[ExportRecord], tmp_path: Path
    ) -> None:
        bare = write_export(tmp_path / "bare", records, images=False)
        view = touchline.open(bare).views[0]
        (tmp_path / "flat").mkdir()
        (tmp_path / "flat" / Path(view.file_name).name).write_bytes(b"x")
        frames = FileFrames(tmp_path / "flat")
        other = replace(view, file_name=view.file_name.replace("/Frames-v3/", "/Frames-v3/a/"))
        assert frames.read(view) == frames.read(view) == b"x"
        with pytest.raises(DataError, match="fits two frames"):
            frames.read(other)

    def test_no_name_leads_out_of_the_folder(self, copy: Path) -> None:
        (copy.parent / "secret.png").write_bytes(b"somebody else's")
        view = touchline.open(copy, frames=copy).views[0]
        object.__setattr__(view, "file_name", "../secret.png")
        with pytest.raises(DataError, match="no frame"):
            view.frame()

    @pytest.mark.parametrize("orientation", [3, 6])
    def test_a_frame_that_exif_turns_is_decoded_upright(
        self, records: list[ExportRecord], tmp_path: Path, orientation: int
    ) -> None:
        view = touchline.open(write_export(tmp_path / "bare", records, images=False)).views[0]
        upright = np.zeros((view.height, view.width, 3), np.uint8)
        upright[:60, :60] = 200
        # A decoder turns stored pixels clockwise: by 180 degrees, or by 90.
        stored = np.rot90(upright, 2 if orientation == 3 else 1)
        exif = Image.Exif()
        exif[0x0112] = orientation
        target = tmp_path / "frames" / view.file_name
        target.parent.mkdir(parents=True)
        Image.fromarray(stored).save(target, exif=exif.tobytes())
        found = touchline.open(tmp_path / "bare", frames=tmp_path / "frames").views[0]
        assert np.abs(found.image(resize=False).astype(int) - upright).max() < 30

    @pytest.mark.parametrize("suffix", ["jpg", "png"])
    @pytest.mark.parametrize("stored", [None, 1, 6])
    def test_xmp_turns_no_frame_as_it_turns_none_on_the_server(
        self, records: list[ExportRecord], tmp_path: Path, stored: int | None, suffix: str
    ) -> None:
        view = touchline.open(write_export(tmp_path / "bare", records, images=False)).views[0]
        xmp = b'<x:xmpmeta><rdf:Description tiff:Orientation="6"/></x:xmpmeta>'
        options: dict[str, Any] = {"xmp": xmp}
        if suffix == "png":
            options = {"pnginfo": PngInfo()}
            options["pnginfo"].add_itxt("XML:com.adobe.xmp", xmp.decode())
        if stored is not None:
            exif = Image.Exif()
            exif[0x0112] = stored
            options["exif"] = exif.tobytes()
        target = tmp_path / "frames" / view.file_name
        target.parent.mkdir(parents=True)
        kind = "JPEG" if suffix == "jpg" else "PNG"
        Image.new("RGB", (40, 20)).save(target, kind, **options)
        header = read_header(target.read_bytes())
        found = touchline.open(tmp_path / "bare", frames=tmp_path / "frames").views[0]
        assert found.image(resize=False).shape == (header.height, header.width, 3)
        assert (header.width, header.height) == ((20, 40) if stored == 6 else (40, 20))

    def test_a_larger_frame_is_shown_at_the_annotated_size(self, export: Path) -> None:
        view = touchline.open(export).views[1]
        object.__setattr__(view, "width", view.width // 2)
        assert view.image().shape == (view.height, view.width, 3)
        assert view.image(resize=False).shape == (view.height, view.width * 2, 3)
        assert np.unique(view.image()).tolist() == [40]
