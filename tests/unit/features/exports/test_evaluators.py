"""Exports as the programs of others walk them: the public evaluators, and readers of tables."""

from __future__ import annotations

import csv
import json
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest

from app.db.store import Store
from app.features.exports.service import export_dataset
from app.features.file_tools.calibrate import score_camera_files
from app.soccer.annotation import Extras
from app.soccer.frames import ImageSize
from tests.foreign_readers import read_by

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
        return export_dataset(store, "demo", format_, tmp_path / format_, everything=True).out

    return write


CALIBRATION = """
from SoccerNet.Evaluation.CameraCalibration import evaluate
for folder in sorted(path.name for path in (root / "lines").iterdir()):
    for part in ("lines", "cameras"):
        with ZipFile(f"{part}.zip", "w") as archive:
            for path in (root / part / folder).iterdir():
                archive.write(path, f"{folder}/{path.name}")
    width, height = map(int, folder.rsplit("-", 1)[1].split("x"))
    scores = evaluate(
        "lines.zip", "cameras.zip", threshold=5, width=width, height=height, folder=folder
    )
    found[folder] = {name: float(scores[name]) for name in ("completeness", "meanAccuracies")}
"""


class TestSnCalibration:
    def test_its_evaluator_takes_every_frame_once_and_at_its_size(
        self, written, tmp_path: Path
    ) -> None:
        found = read_by(CALIBRATION, written("sn-calibration"), tmp_path)
        assert sorted(found) == FOLDERS
        for scores in found.values():
            assert scores["completeness"] == 1.0
            assert scores["meanAccuracies"] > 0.99

    @pytest.mark.parametrize("parts", [("lines", "cameras"), (".", ".")])
    def test_our_own_score_reads_it_as_well(self, written, parts: tuple[str, str]) -> None:
        root = written("sn-calibration")
        # The usual size, which is not that of the export: its folders say theirs.
        found = score_camera_files(*(root / part for part in parts), size=ImageSize(960, 540))
        assert (found["frames"], found["completeness"]) == (4, 1.0)
        assert found["fs5"] > 0.99

    def test_our_own_score_knows_the_size_of_one_folder_of_it(self, written) -> None:
        root = written("sn-calibration")
        folders = [root / part / FOLDERS[0] for part in ("lines", "cameras")]
        found = score_camera_files(*folders, size=ImageSize(960, 540))
        assert found["frames"] == 2
        assert found["fs5"] > 0.99


GAMESTATE = """
import trackeval
for split in sorted(path.name for path in root.iterdir() if path.is_dir()):
    told = Path("trackers") / f"SoccerNetGS-{split}" / "self" / "data"
    told.mkdir(parents=True)
    for truth in (root / split).glob("*/Labels-GameState.json"):
        boxes = json.loads(truth.read_text())["annotations"]
        people = [box for box in boxes if box.get("bbox_pitch")]
        (told / f"{truth.parent.name}.json").write_text(json.dumps({"predictions": people}))
    config = trackeval.datasets.SoccerNetGS.get_default_dataset_config()
    config |= {"GT_FOLDER": str(root), "TRACKERS_FOLDER": "trackers", "SPLIT_TO_EVAL": split}
    data = trackeval.datasets.SoccerNetGS(config)
    raw = [data._load_raw_file("self", name, True) for name in data.seq_list]
    quiet = trackeval.Evaluator.get_default_eval_config()
    quiet |= {name: False for name in quiet if name.startswith(("OUTPUT", "PLOT", "PRINT"))}
    hota = trackeval.metrics.HOTA({"METRICS": ["HOTA"], "THRESHOLD": 0.5})
    scores, _ = trackeval.Evaluator(quiet).evaluate([data], [hota])
    person = scores["SoccerNetGS"]["self"]["COMBINED_SEQ"]["person"]
    found[split] = {
        "frames": sum(sequence["num_timesteps"] for sequence in raw),
        "people": sum(len(ids) for sequence in raw for ids in sequence["gt_ids"]),
        "hota": float(person["HOTA"]["HOTA"].mean()),
    }
"""


class TestGamestate:
    def test_its_evaluator_takes_every_frame_and_everybody(self, written, tmp_path: Path) -> None:
        found = read_by(GAMESTATE, written("gamestate"), tmp_path)
        whole = {"frames": 2, "people": 2, "hota": 1.0}
        assert found == {"test": whole, "train": whole}


COCO = """
from pycocotools.coco import COCO
from pycocotools.cocoeval import COCOeval
for path in sorted((root / "annotations").glob("*.json")):
    truth = COCO(str(path))
    boxes = truth.loadAnns(truth.getAnnIds())
    names = ("image_id", "category_id", "bbox")
    same = [{**{name: box[name] for name in names}, "score": 1.0} for box in boxes]
    judge = COCOeval(truth, truth.loadRes(same), "bbox")
    judge.evaluate(), judge.accumulate(), judge.summarize()
    found[path.stem] = {"images": len(truth.imgs), "boxes": len(boxes), "ap": float(judge.stats[0])}
"""


class TestCoco:
    def test_its_tools_count_every_ball(self, written, tmp_path: Path) -> None:
        found = read_by(COCO, written("coco"), tmp_path)
        whole = {"images": 2, "boxes": 2, "ap": 1.0}
        assert found == {"instances_test": whole, "instances_train": whole}


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
