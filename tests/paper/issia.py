"""ISSIA-3D: what the real files give, and a simulated detector on the paper's test cameras."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

from app.db.store import Store
from app.evaluation.evaluate import Evaluation, EvaluationInputs, EvaluationOptions, evaluate
from app.evaluation.frame import GroundTruthFrame
from app.features.datasets.service import get_dataset
from app.features.imports.ingest import import_groups
from app.features.predictions.frames import read_live_truth
from app.features.solutions.service import solve_dataset
from app.formats.issia_reader import IssiaOptions, open_issia
from app.formats.report import ReaderReport
from app.soccer.split import TEST_CAMERAS
from tests.paper.simulated import SimulatedDetector

FOLDER = (
    Path(os.environ.get("TOUCHLINE_REAL_DATA", Path(__file__).parents[3] / "shared" / "data"))
    / "issia"
)
DATASET = "issia"


@dataclass(frozen=True)
class Issia:
    """What came of ISSIA under the policy ``paper``.

    Attributes:
        groups: Frames of the recording that keep a 3D ball.
        train: Images of cameras 3 to 6 in a valid pair; ``test``: of cameras 1 and 2.
        found: A detector that learnt from optimised boxes, on the test cameras.
    """

    groups: int
    train: int
    test: int
    found: Evaluation


def run_issia(store: Store, seed: int, folder: Path = FOLDER) -> Issia | None:
    """Import, solve and evaluate ISSIA; None where its files are not there."""
    if not folder.is_dir():
        return None
    import_groups(
        store,
        DATASET,
        open_issia(folder, IssiaOptions(), ReaderReport()).groups(),
        source="ISSIA",
        actor="study",
    )
    solve_dataset(store, DATASET)
    with store.read() as session:
        frames = read_live_truth(session, get_dataset(store, DATASET), "passing", None).frames
    placed = [frame for frame in frames if frame.point is not None and "optimized" in frame.boxes]
    tested = [frame for frame in placed if frame.station in _TEST]
    detector = SimulatedDetector(1.0, seed)
    detections = {
        frame.id: detector.detect(_key(frame), frame.boxes["optimized"], frame.size)
        for frame in tested
    }
    return Issia(
        groups=len({frame.group_id for frame in placed}),
        train=len(placed) - len(tested),
        test=len(tested),
        found=evaluate(tested, EvaluationInputs(detections), EvaluationOptions()),
    )


_TEST = frozenset(TEST_CAMERAS)


def _key(frame: GroundTruthFrame) -> str:
    return f"{frame.group} {frame.view}"
