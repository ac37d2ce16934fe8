"""Evaluations: runs over a pinned state of a dataset, kept with everything that they found."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from app.errors import InputError, NotFoundError
from app.evaluation.comparison import (
    FIELDS,
    Difference,
    FrameComparison,
    compare_frames,
    compare_tables,
    differing_pins,
)
from app.evaluation.evaluate import Inputs, Options, evaluate
from app.evaluation.figure import Figure
from app.evaluation.frame import BOX_KINDS, Detection
from app.evaluation.result import NUMBERS, Evaluation, FrameResult
from app.evaluation.table import Table
from app.progress import Progress
from app.review.datasets.dataset import Dataset, read_dataset
from app.review.evaluating.careful_boxes import careful_boxes
from app.review.evaluating.frames import LIVE_RULES, Truth, live_truth, version_truth
from app.review.evaluating.predictions import read_set
from app.review.evaluating.truth import AcceptedTruth
from app.review.versions.version import Version, read_version
from app.soccer.frames import Box
from app.store import evaluation_frames as frame_rows
from app.store.clock import now
from app.store.codecs import Json
from app.store.evaluation_frames import FrameCondition
from app.store.evaluations import (
    StoredEvaluation,
    dataset_evaluations,
    delete_evaluation,
    find_evaluation,
    insert_evaluation,
    read_figure,
)
from app.store.predictions import (
    PredictionSet,
    read_boxes,
    read_predicted_cameras,
)
from app.store.session import Session, Store
from app.store.value_codec import from_json, to_json

MAX_PAGE = 500
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
        boxes: Which box of the dataset is the truth, one of ``frame.BOX_KINDS``.
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
            raise InputError(f"boxes are {', '.join(BOX_KINDS)}", pointer="/boxes")
        if not 0 <= self.min_score <= 1:
            raise InputError("a score lies between 0 and 1", pointer="/min_score")
        if len(self.name) > MAX_NAME:
            raise InputError(f"a name has at most {MAX_NAME} characters", pointer="/name")


@dataclass(frozen=True)
class FrameQuery:
    """Which frames of a run, in which order.

    Attributes:
        field: Frames whose field (of ``result.NUMBERS``) lies in [low, high); None: all.
        missing: Frames without a value in ``field`` instead.
        sort: Field, descending with ``-desc``; empty: as they stand in the dataset.
    """

    field: str | None = None
    low: float | None = None
    high: float | None = None
    missing: bool = False
    match: str | None = None
    sort: str = ""


@dataclass(frozen=True)
class FramePage:
    """Frames of a run; ``next`` is the place of the next page, None at the end."""

    items: list[FrameResult]
    next: int | None
    total: int


@dataclass(frozen=True)
class Comparison:
    """Two runs of one dataset.

    Attributes:
        same_truth: Whether their numbers can be compared.
        differs: Pins in which they differ: those that make it another truth, and the version of
            the software.
    """

    first: StoredEvaluation
    second: StoredEvaluation
    same_truth: bool
    differs: tuple[str, ...]
    numbers: list[Difference]
    frames: FrameComparison


def run_evaluation(
    store: Store,
    dataset: str | int,
    request: EvaluationRequest,
    *,
    actor: str,
    progress: Progress | None = None,
) -> StoredEvaluation:
    """Evaluate and keep the result; what it pins makes it repeatable.

    Raises:
        NotFoundError: There is no such dataset, set or version.
        InputError: The request says something impossible, or no frame takes part.
        ConflictError: Groups that might take part have no solution.
    """
    request.check()
    with store.read() as session:
        found = read_dataset(session, dataset)
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
        found = read_dataset(session, dataset)
        for name in ("predictions", "careful"):
            if (identity := getattr(request, name)) is not None:
                own = _own_set(session, found, identity, name)
                if name == "careful":
                    careful_boxes(session, own)
        if request.version is not None:
            _own_version(session, found, request.version)
        elif request.groups not in LIVE_RULES:
            raise InputError(f"groups are {', '.join(LIVE_RULES)}", pointer="/groups")


def list_evaluations(store: Store, dataset: str | int) -> list[StoredEvaluation]:
    """The runs of a dataset, the newest first."""
    with store.read() as session:
        found = read_dataset(session, dataset)
        return dataset_evaluations(session, found.id)


def get_evaluation(store: Store, evaluation_id: int) -> StoredEvaluation:
    """A run by its id.

    Raises:
        NotFoundError: There is none.
    """
    with store.read() as session:
        return _read(session, evaluation_id)


def remove_evaluation(store: Store, evaluation_id: int) -> None:
    """Delete a run.

    Raises:
        NotFoundError: There is none.
    """
    with store.write() as session:
        _read(session, evaluation_id)
        delete_evaluation(session, evaluation_id)


def tables_of(evaluation: StoredEvaluation) -> list[Table]:
    """The tables of a run as values."""
    return read_tables(evaluation.tables)


def read_tables(values: Iterable[Json]) -> list[Table]:
    """Tables from JSON."""
    return [from_json(Table, value) for value in values]


def get_figure(store: Store, evaluation_id: int, name: str) -> Figure:
    """One figure of a run.

    Raises:
        NotFoundError: There is no such run, or it has no such figure.
    """
    with store.read() as session:
        known = _read(session, evaluation_id).figures
        value = read_figure(session, evaluation_id, name)
    if value is None:
        raise NotFoundError(
            f'evaluation {evaluation_id} has no figure "{name}"',
            hint=f"It has {', '.join(known)}.",
        )
    return from_json(Figure, value)


def list_frames(
    store: Store, evaluation_id: int, query: FrameQuery, limit: int = 50, offset: int = 0
) -> FramePage:
    """A page of the frames behind a number.

    Raises:
        NotFoundError: There is no such run.
        InputError: The query, the limit or the place is impossible.
    """
    if not 1 <= limit <= MAX_PAGE:
        raise InputError(f"a page has 1 to {MAX_PAGE} frames", pointer="/limit")
    where = _conditions(query)
    sort = _known(query.sort.removesuffix("-desc"), "/sort") if query.sort else None
    descending = query.sort.endswith("-desc")
    with store.read() as session:
        _read(session, evaluation_id)
        total = frame_rows.count_frame_rows(session, evaluation_id, where)
        rows = frame_rows.read_frame_rows(
            session,
            evaluation_id,
            where,
            sort=sort,
            descending=descending,
            limit=limit,
            offset=offset,
        )
        items = [FrameResult(**row) for row in rows]
    more = offset + len(items) < total
    return FramePage(items, offset + len(items) if more else None, total)


def compare(store: Store, first_id: int, second_id: int, field: str = "error_m") -> Comparison:
    """What changed from one run to another of the same dataset.

    Raises:
        NotFoundError: A run does not exist.
        InputError: They belong to different datasets, or the field has no difference.
    """
    if field not in FIELDS:
        raise InputError(f"frames are compared by {', '.join(FIELDS)}", pointer="/field")
    with store.read() as session:
        first, second = _read(session, first_id), _read(session, second_id)
        if first.dataset_id != second.dataset_id:
            raise InputError("the two runs belong to different datasets", pointer="/with")
        frames = [
            [FrameResult(**row) for row in frame_rows.read_frame_rows(session, item.id)]
            for item in (first, second)
        ]
    differs = differing_pins(first.pins, second.pins)
    return Comparison(
        first,
        second,
        set(differs) <= {"software_version"},
        differs,
        compare_tables(tables_of(first), tables_of(second)),
        compare_frames(frames[0], frames[1], field),
    )


def _truth(session: Session, dataset: Dataset, request: EvaluationRequest) -> Truth:
    if request.version is None:
        return live_truth(session, dataset, request.groups, request.split)
    version = _own_version(session, dataset, request.version)
    return version_truth(session, version, request.split)


def _own_version(session: Session, dataset: Dataset, version_id: int) -> Version:
    version = read_version(session, version_id)
    if version.dataset_id != dataset.id:
        raise NotFoundError(f"dataset {dataset.name} has no version {version_id}")
    return version


def _own_set(session: Session, dataset: Dataset, set_id: int, pointer: str) -> PredictionSet:
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


def _no_frames(dataset: Dataset, request: EvaluationRequest) -> InputError:
    of = f' in the split "{request.split}"' if request.split else ""
    hint = "Groups take part when the policy passes them and nobody rejected them."
    if request.groups == "accepted":
        hint = "Nobody has accepted a group; evaluate the passing ones, or accept some."
    return InputError(f'no group of "{dataset.name}" takes part{of}', hint=hint)


def _save(store: Store, values: Mapping[str, Any], result: Evaluation) -> StoredEvaluation:
    figures = {figure.name: to_json(figure) for figure in result.figures}
    with store.write() as session:
        identity = insert_evaluation(session, values, figures, result.frames)
        return _read(session, identity)


def _read(session: Session, evaluation_id: int) -> StoredEvaluation:
    found = find_evaluation(session, evaluation_id)
    if found is None:
        raise NotFoundError(f"there is no evaluation {evaluation_id}")
    return found


def _conditions(query: FrameQuery) -> list[FrameCondition]:
    where = [] if query.match is None else [frame_rows.is_of_match(query.match)]
    if query.field is not None:
        field = _known(query.field, "/field")
        where.append(
            frame_rows.lacks(field)
            if query.missing
            else frame_rows.lies_in(field, query.low, query.high)
        )
    return where


def _known(field: str, pointer: str) -> str:
    """A field of frames; raises InputError where they have none of that name."""
    if field not in NUMBERS:
        known = ", ".join(NUMBERS)
        raise InputError(
            f'frames have no field "{field}"', hint=f"Fields: {known}.", pointer=pointer
        )
    return field
