"""An evaluation as it runs: over a pinned state of a dataset, kept with everything it found."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from app.errors import InputError, NotFoundError
from app.evaluation.evaluate import Inputs, Options, evaluate
from app.evaluation.frame import Detection
from app.evaluation.result import Evaluation
from app.finite import quoted
from app.progress import TellProgress
from app.review.datasets.dataset import DatasetHead, read_dataset_head
from app.review.evaluating.careful_boxes import careful_boxes
from app.review.evaluating.evaluation import read_evaluation
from app.review.evaluating.frames import LIVE_RULES, Truth, live_truth, unknown_rule, version_truth
from app.review.evaluating.predictions import read_set
from app.review.evaluating.truth import AcceptedTruth
from app.review.versions.version import Version, read_version
from app.soccer.ball_boxes import BOX_KINDS
from app.soccer.frames import Box
from app.store.clock import now
from app.store.evaluations import (
    StoredEvaluation,
    insert_evaluation,
)
from app.store.predictions import (
    PredictionSet,
    read_boxes,
    read_predicted_cameras,
)
from app.store.session import Session
from app.store.store import Store
from app.store.stored_json import Json
from app.store.value_codec import to_json

MAX_NAME = 100
_SET_PINS = ("id", "name", "digest", "source", "unknown")


@dataclass(frozen=True)
class EvaluationRequest:
    """What to evaluate, and against which truth.

    Attributes:
        name: For people; empty: named after the predictions.
        predictions: Set of ball boxes, cameras or both; None only where ``careful`` is given.
        careful: Set whose boxes are careful ones, which the dataset's boxes are measured with.
        version: Frozen version; None: the dataset as it is now.
        groups: Without a version: ``passing``, ``accepted`` or ``all``.
        split: Frames of this split alone; None: all.
        boxes: Which box of the dataset is the truth, one of ``ball_boxes.BOX_KINDS``.
        min_score: Detections below take no part in localisation.
    """

    name: str = ""
    predictions: int | None = None
    careful: int | None = None
    version: int | None = None
    groups: str = "passing"
    split: str | None = None
    boxes: str = "optimized"
    min_score: float = 0.0

    def check(self) -> None:
        """Raise InputError where it says something impossible."""
        if self.predictions is None and self.careful is None:
            raise InputError("there is nothing to evaluate", pointer="/predictions")
        if self.boxes not in BOX_KINDS:
            raise InputError(
                f"boxes must be one of {', '.join(BOX_KINDS)}, not {quoted(self.boxes)}",
                pointer="/boxes",
            )
        if not 0 <= self.min_score <= 1:
            raise InputError(
                f"a score lies between 0 and 1, and min_score is {self.min_score:g}",
                pointer="/min_score",
            )
        if len(self.name) > MAX_NAME:
            raise InputError(f"a name has at most {MAX_NAME} characters", pointer="/name")
        check_groups(self.groups, self.version)


def check_groups(groups: str, version: int | str | None) -> None:
    """Refuse a rule for groups beside a version, which has its own groups.

    Raises:
        InputError: There are both.
    """
    if version is not None and groups != EvaluationRequest.groups:
        raise InputError(
            f"a version has its own groups, so that groups {quoted(groups)} is not used",
            hint="Leave the groups or the version out.",
            pointer="/groups",
        )


def run_evaluation(
    store: Store,
    dataset: str | int,
    request: EvaluationRequest,
    *,
    actor: str,
    progress: TellProgress | None = None,
) -> StoredEvaluation:
    """Evaluate and keep the result; what it pins makes it repeatable.

    Raises:
        NotFoundError: There is no such dataset, set or version.
        InputError: The request says something impossible, or no frame takes part.
        ConflictError: Groups that might take part have no solution.
    """
    request.check()
    with store.read() as session:
        found = read_dataset_head(session, dataset)
        if progress is not None:
            progress(0, None, "Reading frames.")
        truth = _truth(session, found, request)
        sets = {
            name: _own_set(session, found, identity, name)
            for name in ("predictions", "careful")
            if (identity := getattr(request, name)) is not None
        }
        inputs = _inputs(session, sets)
    if not truth.frames:
        raise _no_frames(found, request)
    _require_common_frames(truth, inputs, sets)
    options = Options(
        boxes=request.boxes,
        min_score=request.min_score,
        ball_diameter_m=truth.policy.ball_diameter_m,
        min_jac=truth.policy.min_jac,
    )
    result = evaluate(truth.frames, inputs, options, progress)
    own = sets["predictions"].name if "predictions" in sets else None
    accepted = AcceptedTruth.count(truth.frames, request.boxes, own)
    values = {
        "dataset_id": found.id,
        "name": request.name or " and ".join(item.name for item in sets.values()),
        "created": now(),
        "actor": actor,
        "prediction_set_id": request.predictions,
        "careful_set_id": request.careful,
        "version_id": request.version,
        "pins": {**truth.pins, **_pins(request, options, sets)},
        "counts": {
            **result.counts,
            "gone": truth.gone,
            "accepted_predictions": accepted.frames,
            **_set_counts(sets),
        },
        "tables": [to_json(table) for table in accepted.warn(result.tables)],
    }
    return _save(store, values, result)


def check_evaluation(store: Store, dataset: str | int, request: EvaluationRequest) -> None:
    """Refuse at once what ``run_evaluation`` would refuse for its sets or its version."""
    request.check()
    with store.read() as session:
        found = read_dataset_head(session, dataset)
        for name in ("predictions", "careful"):
            if (identity := getattr(request, name)) is not None:
                own = _own_set(session, found, identity, name)
                if name == "careful":
                    careful_boxes(session, own)
        if request.version is not None:
            _own_version(session, found, request.version)
        elif request.groups not in LIVE_RULES:
            raise unknown_rule(request.groups)


def _truth(session: Session, dataset: DatasetHead, request: EvaluationRequest) -> Truth:
    if request.version is None:
        return live_truth(session, dataset, request.groups, request.split)
    version = _own_version(session, dataset, request.version)
    return version_truth(session, version, request.split)


def _own_version(session: Session, dataset: DatasetHead, version_id: int) -> Version:
    version = read_version(session, version_id)
    if version.dataset_id != dataset.id:
        raise NotFoundError(f"dataset {dataset.name} has no version {version_id}")
    return version


def _own_set(session: Session, dataset: DatasetHead, set_id: int, pointer: str) -> PredictionSet:
    found = read_set(session, set_id)
    if found.dataset_id != dataset.id:
        raise InputError(
            f'predictions "{found.name}" belong to another dataset', pointer=f"/{pointer}"
        )
    return found


def _inputs(session: Session, sets: Mapping[str, PredictionSet]) -> Inputs:
    predictions, careful = sets.get("predictions"), sets.get("careful")
    detections = cameras = boxes = None
    if predictions is not None:
        if predictions.boxes or not predictions.cameras:
            detections = {
                view: [Detection(Box(b.x, b.y, b.width, b.height), b.score) for b in found]
                for view, found in read_boxes(session, predictions.id).items()
            }
        if predictions.cameras:
            cameras = read_predicted_cameras(session, predictions.id)
    if careful is not None:
        boxes = careful_boxes(session, careful)
    return Inputs(detections, boxes, cameras)


def _pins(
    request: EvaluationRequest, options: Options, sets: Mapping[str, PredictionSet]
) -> dict[str, Json]:
    """What was asked for, beside what the truth pins."""
    return {
        "split": request.split,
        "boxes": options.boxes,
        "min_score": options.min_score,
        "resamples": options.resamples,
        "seed": options.seed,
        **{name: {part: getattr(item, part) for part in _SET_PINS} for name, item in sets.items()},
    }


def _set_counts(sets: Mapping[str, PredictionSet]) -> dict[str, int]:
    return {f"unknown_{name}_frames": item.unknown for name, item in sets.items()}


def _no_frames(dataset: DatasetHead, request: EvaluationRequest) -> InputError:
    of = f' in the split "{request.split}"' if request.split else ""
    hint = "Groups take part when the policy passes them and nobody rejected them."
    if request.groups == "accepted":
        hint = "Nobody has accepted a group; evaluate the passing ones, or accept some."
    return InputError(f'no group of "{dataset.name}" takes part{of}', hint=hint)


def _require_common_frames(truth: Truth, inputs: Inputs, sets: Mapping[str, PredictionSet]) -> None:
    """Refuse predictions of which none belongs to a frame that takes part: AP 0 would be false."""
    frames = {frame.id for frame in truth.frames}
    for name, predicted in (
        ("predictions", {*(inputs.detections or {}), *(inputs.cameras or {})}),
        ("careful", set(inputs.careful or {})),
    ):
        if predicted and not predicted & frames:
            raise InputError(
                f'none of the {len(predicted)} frames of "{sets[name].name}" is among the {len(frames)} '
                "frames that take part",
                hint="Name the split or the version that the predictions were made for.",
                pointer=f"/{name}",
            )


def _save(store: Store, values: Mapping[str, Any], result: Evaluation) -> StoredEvaluation:
    figures = {figure.name: to_json(figure) for figure in result.figures}
    with store.write() as session:
        identity = insert_evaluation(session, values, figures, result.frames)
        return read_evaluation(session, identity)
