from __future__ import annotations

import hashlib
import json
from pathlib import Path

from app.formats.manifest import LICENCES, Manifest, write_manifest


class TestWriteManifest:
    def test_every_file_is_listed_with_its_digest(self, tmp_path: Path) -> None:
        (tmp_path / "b").mkdir()
        (tmp_path / "b" / "x.json").write_text("{}")
        (tmp_path / "a.csv").write_text("1")
        manifest = Manifest(
            "sample",
            "soccernet-v3d",
            "2030-01-02T03:04:05Z",
            {"groups": 2},
            {"boxes": "optimized"},
            LICENCES["sample"],
        )
        value = json.loads(write_manifest(tmp_path, manifest).read_text())
        assert value["files"] == [
            {"path": "a.csv", "bytes": 1, "sha256": hashlib.sha256(b"1").hexdigest()},
            {"path": "b/x.json", "bytes": 2, "sha256": hashlib.sha256(b"{}").hexdigest()},
        ]
        assert (value["dataset"], value["version"], value["date"], value["counts"]) == (
            "sample", None, "2030-01-02T03:04:05Z", {"groups": 2},
        )  # fmt: skip
        assert value["software"]["name"] == "touchline"
        assert value["settings"] == {"boxes": "optimized"}
        assert value["licence"] == LICENCES["sample"]

    def test_how_many_files_are_read_is_told(self, tmp_path: Path) -> None:
        (tmp_path / "a.csv").write_text("1")
        (tmp_path / "b.csv").write_text("1")
        told: list[tuple] = []
        write_manifest(
            tmp_path,
            Manifest("d", "cameras", "2030-01-02", {}),
            lambda *place: told.append(place),
        )
        assert [place[:2] for place in told] == [(0, 2), (1, 2), (2, 2)]

    def test_the_same_content_makes_the_same_text(self, tmp_path: Path) -> None:
        (tmp_path / "a").write_text("1")
        manifest = Manifest("d", "cameras", "2030-01-02", {})
        first = write_manifest(tmp_path, manifest).read_bytes()
        assert write_manifest(tmp_path, manifest).read_bytes() == first
