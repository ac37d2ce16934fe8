"""The study: a synthetic dataset with known truth, solved and evaluated as the paper did."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from app.db.store import Store
from app.evaluation.evaluate import Evaluation, EvaluationInputs, EvaluationOptions, evaluate
from app.evaluation.frame import Detection, GroundTruthFrame
from app.features.datasets.service import get_dataset
from app.features.imports.ingest import import_groups
from app.features.predictions.frames import EvaluationTruth, read_live_truth
from app.features.solutions.service import solve_dataset
from app.sample.scene import Scene
from app.soccer.frames import Box
from tests.paper.simulated import SimulatedDetector, camera_from_noisy_lines, looseness
from tests.scenes import make_scenes

GROUPS, SEED = 120, 20_260_101
DATASET = "paper"


@dataclass(frozen=True)
class Study:
    """What came of it.

    Attributes:
        base: The detector that learnt from the annotated boxes; ``opt`` from optimised ones.
        looseness: Of the annotated boxes and of the optimised ones, as the detectors learnt it.
    """

    groups: int
    truth: EvaluationTruth
    base: Evaluation
    opt: Evaluation
    looseness: tuple[float, float]


def run_study(
    store: Store, groups: int = GROUPS, seed: int = SEED, *, faults: bool = True
) -> Study:
    """Make the dataset in an empty store, solve it, and evaluate both detectors."""
    scenes = make_scenes(groups=groups, seed=seed, faults=faults)
    import_groups(store, DATASET, [scene.group for scene in scenes], source="study", actor="study")
    solve_dataset(store, DATASET)
    with store.read() as session:
        truth = read_live_truth(session, get_dataset(store, DATASET), "passing", None)
    boxes = true_boxes(scenes)
    ratios = tuple(_learnt(truth.frames, boxes, kind) for kind in ("annotated", "optimized"))
    cameras = _cameras(truth.frames, scenes, seed)
    careful = {frame.id: boxes[_key(frame)] for frame in truth.frames}
    options = EvaluationOptions(min_jac=truth.policy.min_jac)
    base, opt = (
        evaluate(
            truth.frames, EvaluationInputs(_detections(truth.frames, boxes, ratio, seed), careful, cameras),
            options,
        )
        for ratio in ratios
    )  # fmt: skip
    return Study(groups, truth, base, opt, (ratios[0], ratios[1]))


def true_boxes(scenes: Sequence[Scene]) -> dict[str, Box]:
    """The tight box of every view; it takes the place of a box that somebody drew with care."""
    return {
        f"{scene.truth.key} {view.view}": view.ball_box
        for scene in scenes
        for view in scene.truth.views
    }


def _learnt(frames: Sequence[GroundTruthFrame], boxes: Mapping[str, Box], kind: str) -> float:
    pairs = {
        _key(frame): (frame.boxes[kind], boxes[_key(frame)])
        for frame in frames
        if frame.point is not None and kind in frame.boxes
    }
    return looseness(pairs)


def _detections(
    frames: Sequence[GroundTruthFrame], boxes: Mapping[str, Box], ratio: float, seed: int
) -> dict[int, list[Detection]]:
    """The same balls found and missed for both detectors: they differ in their boxes alone."""
    detector = SimulatedDetector(ratio, seed)
    return {
        frame.id: detector.detect(_key(frame), boxes[_key(frame)], frame.size) for frame in frames
    }


def _cameras(
    frames: Sequence[GroundTruthFrame], scenes: Sequence[Scene], seed: int
) -> dict[int, object]:
    views = {
        f"{scene.group.key} {view.key}": (view, scene.group.pitch)
        for scene in scenes
        for view in scene.group.views
    }
    found = {}
    for frame in frames:
        view, pitch = views[_key(frame)]
        camera = camera_from_noisy_lines(view, pitch, seed)
        if camera is not None:
            found[frame.id] = camera
    return found


def _key(frame: GroundTruthFrame) -> str:
    return f"{frame.group} {frame.view}"
