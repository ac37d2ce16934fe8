from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest

from app.formats import parquet
from app.formats.camera_json import camera_to_json
from app.formats.export_record import ExportRecord
from app.formats.parquet import COLUMNS, write_parquet
from app.geometry.camera import Camera
from app.soccer.frames import Box, ImagePoint
from app.soccer.group import Group
from app.soccer.solution import (
    BallFit,
    BestBall,
    Calibration,
    ChiSquare,
    Gate,
    PaintFit,
    ViewSolution,
)

Solved = Callable[..., ExportRecord]
Make = Callable[..., Group]


def rows(root: Path) -> list[dict[str, Any]]:
    table: list[dict[str, Any]] = pq.read_table(root / "views.parquet").to_pylist()
    return table


NUMBERED = {
    "split": "train",
    "group_split": "train",
    "frame_present": True,
    "jac_0.5": 0.1,
    "jac_1": 0.2,
    "jac_2": 0.3,
    "line_error_px": 11.0,
    "agreement": 0.125,
    "sigma_m": 0.4,
    "parallax_degrees": 21.0,
    "point": "best",
    "mean_sigma_m": 0.7,
    "best_sigma_m": 0.6,
    "p_value": 0.8,
    "reprojected": [3.0, 4.0],
    "error_px": 5.0,
    "error_percent": 6.0,
    "optimized_diameter_px": 7.0,
    "optimized_error_m": 8.0,
    "size_ratio": 9.0,
    "depth_m": 10.0,
    "in_valid_pair": True,
    "view_failed": "jac",
    "group_failed": "reprojection",
}
"""Columns of a row whose numbers are all different."""


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

    def test_every_number_stands_in_its_own_column(
        self, tmp_path: Path, solved: Solved, soccer_group: Make, camera: Camera
    ) -> None:
        record = solved(soccer_group())
        solution, view = record.solution, record.group.views[0]
        assert solution is not None and solution.ball is not None
        fit = BallFit(
            ImagePoint(3.0, 4.0), 5.0, 6.0, 7.0, Box(1.0, 2.0, 7.5, 7.5), 8.0, None, 9.0, 10.0
        )
        paint = PaintFit(supported=0.5, explained=0.25, points=9)
        spread = tuple((np.eye(8) * 1e-4).ravel().tolist())
        calibration = Calibration(
            "lines", camera, None, (0.1, 0.2, 0.3), 11.0, covariance=spread, paint=paint
        )
        first = ViewSolution(view.key, calibration, "k", True, "jac", fit)
        ball = replace(solution.ball, sigma_m=0.4, parallax_degrees=21.0)
        best = BestBall((1.0, 2.0, -3.0), (0.5,) * 9, 0.6, ("a", "b"))
        gate = Gate("reprojection", False, 1.0, 2.0, -1.0, "no")
        numbered = replace(
            solution,
            views=(first, *solution.views[1:]),
            ball=ball,
            mean_ball=replace(ball, sigma_m=0.7),
            best_ball=best,
            chi_square=ChiSquare(1.0, 2, 0.8, ("a", "b")),
            gates=(gate,),
        )
        frames = {view.key: "frames/7.png"}
        group = replace(record.group, split="train")
        record = replace(record, group=group, solution=numbered, frames=frames)
        counts = write_parquet(tmp_path, [record], everything=True)
        found, other = rows(tmp_path)
        pan, tilt, roll = camera.pan_tilt_roll_degrees
        expected = NUMBERED | {"pan_degrees": pan, "tilt_degrees": tilt, "roll_degrees": roll}
        assert {name: found[name] for name in expected} == expected
        assert len({pan, tilt, roll}) == 3
        told = camera_to_json(camera, spread, view.size)["covariance"]
        assert found["camera_covariance"] == np.ravel(told).tolist()
        assert other["camera_covariance"] is None
        assert (other["frame_present"], other["in_valid_pair"]) == (False, True)
        assert counts["boxes"] == sum(row["box_width"] is not None for row in (found, other))

    def test_row_groups_are_written_as_they_fill(
        self, tmp_path: Path, solved: Solved, soccer_group: Make, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr(parquet, "ROWS", 4)
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

    @pytest.mark.parametrize("balls", [0, 2])
    def test_a_view_without_one_ball_has_no_box(
        self, tmp_path: Path, solved: Solved, soccer_group: Make, balls: int
    ) -> None:
        group = soccer_group()
        first = group.views[0]
        counts = write_parquet(
            tmp_path, [solved(group.with_view(replace(first, balls=first.balls[:1] * balls)))]
        )
        assert [row["box_x"] is None for row in rows(tmp_path)] == [True, False]
        assert counts["boxes"] == 1

    def test_an_export_without_rows_still_has_its_columns(self, tmp_path: Path) -> None:
        write_parquet(tmp_path, [])
        file = pq.ParquetFile(tmp_path / "views.parquet")
        assert file.schema_arrow.names == list(COLUMNS)
        assert len(set(file.schema_arrow.names)) == len(COLUMNS)

    def test_every_value_of_a_row_has_a_column(
        self, tmp_path: Path, solved: Solved, soccer_group: Make, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        made: list[dict[str, Any]] = []

        def keep(row: dict[str, Any]) -> dict[str, Any]:
            made.append(row)
            return row

        monkeypatch.setattr(parquet, "replace_non_finite", keep)
        write_parquet(tmp_path, [solved(soccer_group())], everything=True)
        assert made and not {name for row in made for name in row} - set(COLUMNS)

    def test_the_same_records_make_the_same_bytes(
        self, tmp_path: Path, solved: Solved, soccer_group: Make
    ) -> None:
        for name in ("a", "b"):
            (tmp_path / name).mkdir()
            write_parquet(tmp_path / name, [solved(soccer_group())])
        first, second = ((tmp_path / name / "views.parquet").read_bytes() for name in ("a", "b"))
        assert first == second
