from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from app.formats.export_record import ExportRecord
from app.formats.file_tree import ImportLimits
from app.formats.parquet import read_parquet, write_parquet
from app.formats.report import ReaderReport
from app.geometry.camera import Camera
from app.soccer.group import Group, ViewExclusion
from app.soccer.picture import PictureGeometry

Solved = Callable[..., ExportRecord]
Make = Callable[..., Group]
COVARIANCE = tuple(np.diag(np.arange(1, 9) / 7).ravel().tolist())


class TestReadParquet:
    def test_a_file_alone_a_folder_and_a_zip_give_the_same(
        self, tmp_path: Path, solved: Solved, soccer_group: Make, make_zip: Callable[..., Path],
        report: ReaderReport, camera: Camera,
    ) -> None:  # fmt: skip
        groups = [soccer_group(), soccer_group("8.png", split="test", label="x")]
        why = ViewExclusion("other", "another match")
        known = replace(groups[0].views[0].station, given=camera, given_covariance=COVARIANCE)
        known = replace(known, picture=PictureGeometry(1.25, (0.5, -0.25), (0.125, 0.0, 0.5)))
        known = replace(known, proposed=(min(known.lines),))
        known = replace(known, flipped=True)
        seen = replace(groups[0].views[0].balls[0], inferred=True, occluded=True)
        first = replace(groups[0].views[0], station=known, balls=(seen,))
        groups[0] = replace(groups[0].with_view(first), split="valid")
        groups[1] = groups[1].with_view(replace(groups[1].views[1], included=False, left_out=why))
        folder = tmp_path / "out"
        folder.mkdir()
        splits = {view.key: "train" for view in groups[0].views}
        records = [replace(solved(groups[0]), splits=splits), solved(groups[1])]
        write_parquet(folder, records)
        packed = make_zip({"views.parquet": (folder / "views.parquet").read_bytes()})
        for place in (folder, folder / "views.parquet", packed):
            assert list(read_parquet(place, report)) == groups
        assert report.problems == []

    def test_a_group_split_by_camera_is_in_no_split_itself(
        self, tmp_path: Path, solved: Solved, soccer_group: Make, report: ReaderReport
    ) -> None:
        group = soccer_group(split="")
        splits = dict(zip((view.key for view in group.views), ("train", "test"), strict=True))
        write_parquet(tmp_path, [replace(solved(group), splits=splits)])
        assert [group.split for group in read_parquet(tmp_path, report)] == [""]
        table = pq.read_table(tmp_path / "views.parquet").drop_columns(["group_split"])
        pq.write_table(table, tmp_path / "views.parquet")
        # Of an export that does not say it, the first view tells.
        assert [group.split for group in read_parquet(tmp_path, report)] == ["train"]

    def test_a_split_has_one_spelling(
        self, tmp_path: Path, solved: Solved, soccer_group: Make, report: ReaderReport
    ) -> None:
        groups = [soccer_group(split="Validation"), soccer_group("8.png", split="fold-3")]
        write_parquet(tmp_path, map(solved, groups))
        assert [group.split for group in read_parquet(tmp_path, report)] == ["valid", "fold-3"]
        assert "fold-3" in report.remarks[0]

    @pytest.mark.parametrize("content", [b"", b"PAR1", b"PAR1" + b"\x00" * 200 + b"PAR1"])
    def test_a_damaged_file_is_reported(
        self, tmp_path: Path, report: ReaderReport, content: bytes
    ) -> None:
        (tmp_path / "a.parquet").write_bytes(content)
        assert list(read_parquet(tmp_path, report)) == []
        assert "not a sound Parquet file" in report.problems[0].problem

    def test_another_table_is_refused_by_its_first_missing_column(
        self, tmp_path: Path, report: ReaderReport
    ) -> None:
        pq.write_table(pa.table({"group": ["a"]}), tmp_path / "a.parquet")
        assert list(read_parquet(tmp_path, report)) == []
        assert report.problems[0].field == "view"

    def test_a_row_that_is_wrong_is_named_and_left_out(
        self, tmp_path: Path, solved: Solved, soccer_group: Make, report: ReaderReport
    ) -> None:
        write_parquet(tmp_path, [solved(soccer_group()), solved(soccer_group("8.png"))])
        path = tmp_path / "views.parquet"
        rows = pq.read_table(path).to_pylist()
        rows[0]["lines"] = '{"Midfield": []}'
        rows[1]["lines"] = "[" * 100
        pq.write_table(pa.Table.from_pylist(rows), path)
        (group,) = read_parquet(tmp_path, report)
        assert group.key.endswith("8.png")
        records = [item.record for item in report.problems]
        assert records == ["row 1", "row 2, lines"]

    def test_a_member_beyond_the_limit_is_refused(
        self, tmp_path: Path, solved: Solved, soccer_group: Make, make_zip: Callable[..., Path],
        report: ReaderReport,
    ) -> None:  # fmt: skip
        write_parquet(tmp_path, [solved(soccer_group())])
        packed = make_zip({"views.parquet": (tmp_path / "views.parquet").read_bytes()})
        assert list(read_parquet(packed, report, limits=ImportLimits(file_bytes=100))) == []
        assert "longer than 100 bytes" in report.problems[0].problem
