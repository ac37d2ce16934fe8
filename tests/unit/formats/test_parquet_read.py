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
