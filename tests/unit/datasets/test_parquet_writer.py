from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq
import pytest

from app.datasets import parquet_writer
from app.datasets.export_record import ExportRecord
from app.datasets.parquet_writer import COLUMNS, write_parquet
from app.geometry.camera import Camera
from app.soccer.group import Group

Solved = Callable[..., ExportRecord]
Make = Callable[..., Group]


def rows(root: Path) -> list[dict[str, Any]]:
    table: list[dict[str, Any]] = pq.read_table(root / "views.parquet").to_pylist()
    return table


class TestWriteParquet:
    def test_one_row_a_view_with_camera_ball_metrics_verdict_and_provenance(
        self, tmp_path: Path, solved: Solved, soccer_group: Make, match: str, camera: Camera
    ) -> None:
        provenance = {"dataset": "demo", "policy": "paper", "policy_hash": "abc"}
        counts = write_parquet(tmp_path, [solved(soccer_group())], provenance=provenance)
        assert counts == {"groups": 1, "views": 2, "boxes": 2, "balls": 2}
        first, second = rows(tmp_path)
        assert (first["group"], second["view"]) == (f"{match}/7.png", "7_1.png")
        assert first["position_meters"] == camera.position.tolist()
        assert first["distortion"] == camera.distortion.tolist()
        assert (first["jac_0.5"], first["error_px"], first["ball_3d_z"]) == (0.9, 0.75, -0.113)
        assert (first["annotated_width"], first["box_width"]) == (12.0, 10.5)
        assert (first["verdict"], first["dataset"], first["policy_hash"]) == (
            "accepted", "demo", "abc",
        )  # fmt: skip
        assert first["version"] is None

    def test_row_groups_are_written_as_they_fill(
        self, tmp_path: Path, solved: Solved, soccer_group: Make, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr(parquet_writer, "ROWS", 4)
        seen: list[int] = []

        def records() -> Any:
            for number in range(1, 8):
                seen.append(number)
                yield solved(soccer_group(f"{number}.png"))

        write_parquet(tmp_path, records())
        file = pq.ParquetFile(tmp_path / "views.parquet")
        sizes = [file.metadata.row_group(n).num_rows for n in range(file.num_row_groups)]
        assert sizes == [4, 4, 4, 2]

    def test_a_view_that_fell_has_no_ball_values_and_no_nan(
        self, tmp_path: Path, solved: Solved, soccer_group: Make
    ) -> None:
        write_parquet(tmp_path, [solved(soccer_group(replays=3))])
        fallen = rows(tmp_path)[3]
        assert (fallen["ball_3d_x"], fallen["pan_degrees"], fallen["covariance"]) == (None,) * 3
        assert fallen["view_failed"] == "jac"

    def test_an_export_without_rows_still_has_its_columns(self, tmp_path: Path) -> None:
        write_parquet(tmp_path, [])
        file = pq.ParquetFile(tmp_path / "views.parquet")
        assert file.schema_arrow.names == [name for name, _, _ in COLUMNS]
        assert len(set(file.schema_arrow.names)) == len(COLUMNS)

    def test_the_same_records_make_the_same_bytes(
        self, tmp_path: Path, solved: Solved, soccer_group: Make
    ) -> None:
        for name in ("a", "b"):
            (tmp_path / name).mkdir()
            write_parquet(tmp_path / name, [solved(soccer_group())])
        first, second = ((tmp_path / name / "views.parquet").read_bytes() for name in ("a", "b"))
        assert first == second
