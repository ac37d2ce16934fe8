"""Exports as the programs of others walk them: the public evaluators, and readers of tables."""

from __future__ import annotations

import csv
import json
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from app.datasets.camera_json import camera_from_json
from app.datasets.report import Report
from app.datasets.sn_calibration_reader import lines_from_json
from app.review.datasets.batch import score_files
from app.review.exporting.export import export
from app.soccer.annotation import Extras
from app.soccer.frames import ImageSize
from app.soccer.pitch import Pitch
from app.solving.score import FrameScore, score, score_frame
from app.store.session import Store

FOLDERS = ["test-1280x720", "train-1280x720"]
PERSON = {"class": "Player team left", "ID": "7"}


@pytest.fixture
def written(store: Store, fill, make_group, tmp_path: Path):
    """Two groups of two splits, with somebody in every view, exported in a format."""
    groups = []
    for number, split in ((7, "train"), (8, "test")):
        group = make_group(number, split=split)
        box = {**PERSON, "points": {"x1": 600, "y1": 300, "x2": 620, "y2": 380}}
        views = (replace(view, extras=Extras((box,))) for view in group.views)
        groups.append(replace(group, views=tuple(views)))
    fill(*groups)

    def write(format_: str) -> Path:
        return export(store, "demo", format_, tmp_path / format_, everything=True).out

    return write


def evaluated(root: Path, folder: str) -> Iterator[FrameScore | None]:
    """The frames of a split as the evaluator of sn-calibration finds them.

    Every name with ``.json`` in it is a frame; it is called like what stands before the first
    dot; its camera is ``camera_<name>.json`` below the folder of predictions. One size for all.
    """
    width, height = map(int, folder.rsplit("-", 1)[1].split("x"))
    size = ImageSize(width, height)
    for path in (root / "lines" / folder).iterdir():
        if ".json" not in path.name:
            continue
        camera = root / "cameras" / folder / f"camera_{path.name.split('.')[0]}.json"
        if not camera.is_file():
            yield None
            continue
        report = Report()
        lines, _ = lines_from_json(json.loads(path.read_text()), size, "f", report)
        assert report.problems == []
        found = camera_from_json(json.loads(camera.read_text()), "f")
        yield score_frame(found, lines, Pitch(), size)


class TestSnCalibration:
    def test_its_evaluator_takes_every_frame_once_and_at_its_size(self, written) -> None:
        root = written("sn-calibration")
        assert sorted(path.name for path in (root / "lines").iterdir()) == FOLDERS
        for folder in FOLDERS:
            total = score(evaluated(root, folder))
            assert (total.frames, total.completeness) == (2, 1.0)
            assert total.challenge > 0.99

    @pytest.mark.parametrize("parts", [("lines", "cameras"), (".", ".")])
    def test_our_own_score_reads_it_as_well(self, written, parts: tuple[str, str]) -> None:
        root = written("sn-calibration")
        # The usual size, which is not that of the export: its folders say theirs.
        found = score_files(*(root / part for part in parts), size=ImageSize(960, 540))
        assert (found["frames"], found["completeness"]) == (4, 1.0)
        assert found["fs5"] > 0.99

    def test_our_own_score_knows_the_size_of_one_folder_of_it(self, written) -> None:
        root = written("sn-calibration")
        folders = [root / part / FOLDERS[0] for part in ("lines", "cameras")]
        found = score_files(*folders, size=ImageSize(960, 540))
        assert found["frames"] == 2
        assert found["fs5"] > 0.99


class TestGamestate:
    def test_its_evaluator_takes_every_frame(self, written) -> None:
        root = written("gamestate")
        for split in ("train", "test"):
            (sequence,) = (path for path in (root / split).iterdir() if path.is_dir())
            value = json.loads((sequence / "Labels-GameState.json").read_text())
            labelled = [
                image["image_id"]
                for image in value["images"]
                if all(image[f"has_labeled_{what}"] for what in ("pitch", "camera", "person"))
            ]
            assert len(labelled) == 2
            people = [item for item in value["annotations"] if item["category_id"] == 1]
            assert [item["image_id"] for item in people] == labelled
            for person in people:
                places = [
                    f"{axis}_bottom_{name}" for name in ("left", "middle", "right") for axis in "xy"
                ]
                assert all(isinstance(person["bbox_pitch"][place], float) for place in places)
                assert isinstance(person["track_id"], int)


PANDAS = """
import json, sys, pandas
table, frame = pandas.read_csv(sys.argv[1], index_col=0), pandas.read_parquet(sys.argv[2])
counts = [int(frame.ball_3d_x.notna().sum()), int(frame.in_valid_pair.sum())]
print(json.dumps([table.shape, str(table.is_ball.dtype), str(table.replay.dtype), *counts]))
"""


class TestTables:
    def test_a_table_of_pandas_has_a_row_a_view(self, written) -> None:
        table = written("soccernet-v3d") / "SNv3D.csv"
        frame = written("parquet") / "views.parquet"
        # In a process of its own, as its users have it.
        done = subprocess.run(
            [sys.executable, "-c", PANDAS, table, frame], capture_output=True, text=True
        )
        assert done.returncode == 0, done.stderr
        assert json.loads(done.stdout) == [[4, 20], "bool", "float64", 4, 4]

    def test_frames_are_listed_in_csv(self, written) -> None:
        with (written("yolo") / "frames.csv").open(newline="") as file:
            assert len(list(csv.DictReader(file))) == 4
