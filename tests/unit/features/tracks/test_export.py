from __future__ import annotations

import csv
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from app.errors import InputError
from app.features.exports.service import export_dataset, require_exportable
from app.features.groups.submit import load_group_state
from app.features.verdicts.service import set_verdict
from tests.flights import FIRST, flight_groups, places


def rows(path: Path) -> list[dict[str, str]]:
    with path.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def manifest(folder: Path) -> dict[str, Any]:
    found: dict[str, Any] = json.loads((folder / "manifest.json").read_text())
    return found


class TestExport:
    def test_tracks_go_out_though_nobody_accepted_a_group(
        self, store, flight, tmp_path: Path
    ) -> None:
        require_exportable(store, "demo", "tracks")
        report = export_dataset(store, "demo", "tracks", tmp_path / "out")
        assert (report.counts["tracks"], report.counts["frames"]) == (1, 60)
        found = rows(tmp_path / "out/ball.csv")
        assert [int(row["frame"]) for row in found] == list(range(FIRST, FIRST + 60))
        there = [(row, place) for row, place in zip(found, places(60), strict=True) if row["x_m"]]
        off = [np.abs(float(row["z_m"]) - place[2]) for row, place in there]
        assert (len(there) > 55, np.median(off) < 0.1) == (True, True)

    def test_the_manifest_says_how_well_the_ball_is_known(
        self, store, flight, tmp_path: Path
    ) -> None:
        export_dataset(store, "demo", "tracks", tmp_path / "out")
        said = manifest(tmp_path / "out")
        assert said["settings"]["groups"] == "not rejected"
        (track,) = said["tracks"]
        assert (track["stretch"], track["verdict"]) == ("rig", "unreviewed")
        assert track["measurements"] == sum(len(group.views) for group in flight_groups(60))
        assert 0 < track["left_out_median_px"] < 3
        # A pixel is four to six centimetres where these cameras see the ball.
        assert 0.02 < track["left_out_median_m"] / track["left_out_median_px"] < 0.1

    def test_a_rejected_group_takes_part_with_all_alone(
        self, store, flight, tmp_path: Path
    ) -> None:
        etag = load_group_state(store, flight[0]).etag
        set_verdict(store, flight[0], "rejected", "other", note="no ball", if_match=etag, actor="a")
        export_dataset(store, "demo", "tracks", tmp_path / "out")
        export_dataset(store, "demo", "tracks", tmp_path / "all", everything=True)
        first = [rows(tmp_path / name / "ball.csv")[0]["frame"] for name in ("out", "all")]
        assert first == [str(FIRST + 1), str(FIRST)]

    @pytest.mark.parametrize(
        ("form", "names"),
        [
            ("tracab", {"tracab.dat", "tracab_metadata.xml"}),
            ("cdf", {"tracking.jsonl"}),
            ("npz", {"ball.npz"}),
        ],
    )
    def test_other_formats_of_the_ball(
        self, store, flight, tmp_path: Path, form: str, names: set[str]
    ) -> None:
        export_dataset(store, "demo", form, tmp_path / "out")
        assert {path.name for path in (tmp_path / "out").iterdir()} == names | {"manifest.json"}

    def test_groups_of_different_instants_are_refused_before_anything_is_written(
        self, store, fill, make_group
    ) -> None:
        fill(make_group())
        with pytest.raises(InputError, match="follow each other in time") as caught:
            require_exportable(store, "demo", "tracks")
        assert caught.value.hint is not None
