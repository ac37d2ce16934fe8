"""An evaluation as it runs: over a pinned state of a dataset, with its reference boxes, of files or of stored predictions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from app.db.json_columns import Json
from app.db.session import Session, now
from app.db.store import Store
from app.errors import InputError, NotFoundError
from app.evaluation.evaluate import EvaluationInputs, EvaluationOptions, evaluate
from app.evaluation.frame import Detection, GroundTruthFrame
from app.evaluation.result import Evaluation, Table
from app.features.datasets.service import DatasetHead, read_dataset_head
from app.features.groups.view_queries import StoredView, list_dataset_views
from app.features.predictions.evaluation import evaluate_stored_tracks, read_evaluation
from app.features.predictions.frames import (
    LIVE_RULES,
    EvaluationTruth,
    read_live_truth,
    read_version_truth,
    unknown_group_rule_error,
)
from app.features.predictions.queries import (
    PredictionSet,
    StoredEvaluation,
    insert_evaluation,
    read_boxes,
    read_predicted_cameras,
)
from app.features.predictions.reader import PredictionFiles
from app.features.predictions.service import add_predictions, find_predictions, read_set
from app.features.solutions.codec import to_json
from app.features.versions.service import Version, find_version, read_version
from app.json_text import quote_text
from app.progress import ReportProgress
from app.soccer.ball_boxes import BOX_KINDS
from app.soccer.frames import Box

LISTED = 5
"""Frames that a refusal names; all are counted."""


def read_reference_boxes(session: Session, reference: PredictionSet) -> dict[int, Box]:
    """The reference box of each view, by its id.

    Raises:
        InputError: A frame has several; nobody can tell which one would be the truth.
    """
    found = read_boxes(session, reference.id)
    several = {view for view, boxes in found.items() if len(boxes) > 1}
    if several:
        rows = list_dataset_views(session, reference.dataset_id)
        names = [_make_frame_name(row) for row in rows if row.id in several]
        more = f" and {len(names) - LISTED} more" if len(names) > LISTED else ""
        raise InputError(
            f'frames of the reference boxes "{reference.name}" have more than one box: '
            f"{', '.join(names[:LISTED])}{more}",
            hint="Keep the one box of each frame that is the ball.",
            pointer="/careful",
        )
    return {view: Box(box.x, box.y, box.width, box.height) for view, (box,) in found.items()}


def _make_frame_name(row: StoredView) -> str:
    """A view as files of predictions call it."""
    if row.shared:
        return f"{row.key}/{row.group}"
    return f"{row.match}/{row.key}" if row.match else f"{row.group}/{row.key}"


WARNED = ("detection", "localization", "boxes")
"""Tables whose numbers it flatters."""


@dataclass(frozen=True)
class AcceptedTruthCounts:
    """How many frames of a run have a ball that a person accepted from a prediction.

    Attributes:
        frames: From any set.
        own: From the very set that is evaluated.
        of: Frames with the box that is the truth.
    """

    frames: int
    own: int
    of: int

    @staticmethod
    def count(
        frames: Sequence[GroundTruthFrame], boxes: str, name: str | None
    ) -> AcceptedTruthCounts:
        """Count over frames that have a box of that kind; ``name`` is that of the evaluated set."""
        judged = [frame.predicted_by for frame in frames if boxes in frame.boxes]
        return AcceptedTruthCounts(
            sum(map(bool, judged)),
            sum(source == name for source in judged if source),
            len(judged),
        )

    def add_warnings(self, tables: Sequence[Table]) -> list[Table]:
        """The tables, those that are flattered with a warning in their note."""
        if not self.frames:
            return list(tables)
        own = f", {self.own} of them from the evaluated set itself" if self.own else ""
        warning = (
            f"Warning: the ball of {self.frames} of {self.of} frames is an accepted "
            f"prediction{own}; this makes the detector that predicted it look too good."
        )
        return [
            replace(table, note=f"{table.note} {warning}".strip())
            if table.name in WARNED
            else table
            for table in tables
        ]


MAX_NAME = 100
_SET_PINS = ("id", "name", "digest", "source", "unknown")


@dataclass(frozen=True)
class EvaluationRequest:
    """What to evaluate, and against which truth.

    Attributes:
        name: For people; empty: named after the predictions.
        predictions: Set of ball boxes, cameras or both; None only where ``careful`` is given.
        careful: Set of reference boxes, which the dataset's boxes are measured against.
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
            raise InputError(
                "the request names neither predictions nor reference boxes",
                hint="Give `predictions`, `careful` (the set of reference boxes), or both.",
                pointer="/predictions",
            )
        if self.boxes not in BOX_KINDS:
            raise InputError(
                f"boxes must be one of {', '.join(BOX_KINDS)}, not {quote_text(self.boxes)}",
                pointer="/boxes",
            )
        if not 0 <= self.min_score <= 1:
            raise InputError(
                f"min_score is {self.min_score:g}, but it must lie between 0 and 1",
                pointer="/min_score",
            )
        if len(self.name) > MAX_NAME:
            raise InputError(
                f"the name of an evaluation has at most {MAX_NAME} characters", pointer="/name"
            )
        refuse_group_rule_beside_version(self.groups, self.version)


def refuse_group_rule_beside_version(groups: str, version: int | str | None) -> None:
    """Refuse a rule for groups beside a version, which has its own groups.

    Raises:
        InputError: There are both.
    """
    if version is not None and groups != EvaluationRequest.groups:
        raise InputError(
            f"groups {quote_text(groups)} cannot be combined with a version, which has its own groups",
            hint="Leave out the groups or the version.",
            pointer="/groups",
        )


def run_evaluation(
    store: Store,
    dataset: str | int,
    request: EvaluationRequest,
    *,
    actor: str,
    progress: ReportProgress | None = None,
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
        sets = {
            name: _require_own_set(session, found, identity, name)
            for name in ("predictions", "careful")
            if (identity := getattr(request, name)) is not None
        }
        if (tracks := _find_track_set(request, sets)) is not None:
            version = None
            if request.version is not None:
                version = _require_own_version(session, found, request.version)
            result, pins = evaluate_stored_tracks(session, found, version, tracks)
            options, more = EvaluationOptions(), {}
        else:
            truth = _read_truth(session, found, request)
            inputs = _read_inputs(session, sets)
            pins = truth.pins
    if tracks is None:
        if not truth.frames:
            raise _no_frames_error(found, request)
        _require_common_frames(truth, inputs, sets)
        options = EvaluationOptions(
            boxes=request.boxes,
            min_score=request.min_score,
            ball_diameter_m=truth.policy.ball_diameter_m,
            min_jac=truth.policy.min_jac,
        )
        result = evaluate(truth.frames, inputs, options, progress)
        own = sets["predictions"].name if "predictions" in sets else None
        accepted = AcceptedTruthCounts.count(truth.frames, request.boxes, own)
        result = replace(result, tables=tuple(accepted.add_warnings(result.tables)))
        more = {
            "gone": truth.gone,
            "accepted_predictions": accepted.frames,
            **{f"unknown_{name}_frames": item.unknown for name, item in sets.items()},
        }
    values = {
        "dataset_id": found.id,
        "name": request.name or " and ".join(item.name for item in sets.values()),
        "created": now(),
        "actor": actor,
        "prediction_set_id": request.predictions,
        "careful_set_id": request.careful,
        "version_id": request.version,
        "pins": {**pins, **_make_pinned_options(request, options, sets)},
        "counts": {**result.counts, **more},
        "tables": [to_json(table) for table in result.tables],
    }
    return _save_evaluation(store, values, result)


def require_valid_evaluation_request(
    store: Store, dataset: str | int, request: EvaluationRequest
) -> None:
    """Refuse at once what ``run_evaluation`` would refuse for its sets or its version."""
    request.check()
    with store.read() as session:
        found = read_dataset_head(session, dataset)
        sets = {}
        for name in ("predictions", "careful"):
            if (identity := getattr(request, name)) is not None:
                own = sets[name] = _require_own_set(session, found, identity, name)
                if name == "careful":
                    read_reference_boxes(session, own)
        _find_track_set(request, sets)
        if request.version is not None:
            _require_own_version(session, found, request.version)
        elif request.groups not in LIVE_RULES:
            raise unknown_group_rule_error(request.groups)


def _find_track_set(
    request: EvaluationRequest, sets: Mapping[str, PredictionSet]
) -> PredictionSet | None:
    """The set of tracks that is evaluated; None where it is one of boxes or cameras.

    Raises:
        InputError: Something is asked for that tracks have no use for.
    """
    found = sets.get("predictions")
    if found is None or not found.tracks:
        return None
    usual = EvaluationRequest()
    for name in ("careful", "split", "boxes", "min_score"):
        if getattr(request, name) != getattr(usual, name):
            raise InputError(
                f'the predictions "{found.name}" are ball tracks, for which the option {name} is'
                " not used",
                hint="Leave it out, or evaluate boxes by themselves.",
                pointer=f"/{name}",
            )
    return found


def _read_truth(
    session: Session, dataset: DatasetHead, request: EvaluationRequest
) -> EvaluationTruth:
    if request.version is None:
        return read_live_truth(session, dataset, request.groups, request.split)
    version = _require_own_version(session, dataset, request.version)
    return read_version_truth(session, version, request.split)


def _require_own_version(session: Session, dataset: DatasetHead, version_id: int) -> Version:
    version = read_version(session, version_id)
    if version.dataset_id != dataset.id:
        raise NotFoundError(f"dataset {dataset.name} has no version {version_id}")
    return version


def _require_own_set(
    session: Session, dataset: DatasetHead, set_id: int, pointer: str
) -> PredictionSet:
    found = read_set(session, set_id)
    if found.dataset_id != dataset.id:
        raise InputError(
            f'predictions "{found.name}" belong to another dataset', pointer=f"/{pointer}"
        )
    return found


def _read_inputs(session: Session, sets: Mapping[str, PredictionSet]) -> EvaluationInputs:
    predictions, reference = sets.get("predictions"), sets.get("careful")
    detections = cameras = boxes = None
    if predictions is not None:
        if predictions.boxes or not predictions.cameras:
            detections = {
                view: [Detection(Box(b.x, b.y, b.width, b.height), b.score) for b in found]
                for view, found in read_boxes(session, predictions.id).items()
            }
        if predictions.cameras:
            cameras = read_predicted_cameras(session, predictions.id)
    if reference is not None:
        boxes = read_reference_boxes(session, reference)
    return EvaluationInputs(detections, boxes, cameras)


def _make_pinned_options(
    request: EvaluationRequest, options: EvaluationOptions, sets: Mapping[str, PredictionSet]
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


def _no_frames_error(dataset: DatasetHead, request: EvaluationRequest) -> InputError:
    of = f' in the split "{request.split}"' if request.split else ""
    hint = "A group is evaluated when the policy passes it and it is neither rejected nor deferred."
    if request.groups == "accepted":
        hint = "No group is accepted yet: accept some, or evaluate the passing ones."
    return InputError(f'no group of "{dataset.name}" can be evaluated{of}', hint=hint)


def _require_common_frames(
    truth: EvaluationTruth, inputs: EvaluationInputs, sets: Mapping[str, PredictionSet]
) -> None:
    """Refuse predictions of which none belongs to a frame that takes part: AP 0 would be false."""
    frames = {frame.id for frame in truth.frames}
    for name, predicted in (
        ("predictions", {*(inputs.detections or {}), *(inputs.cameras or {})}),
        ("careful", set(inputs.reference or {})),
    ):
        if predicted and not predicted & frames:
            raise InputError(
                f'none of the {len(predicted)} frames of "{sets[name].name}" is among the'
                f" {len(frames)} frames to evaluate",
                hint="Name the split or the version whose frames this set covers.",
                pointer=f"/{name}",
            )


def _save_evaluation(
    store: Store, values: Mapping[str, Any], result: Evaluation
) -> StoredEvaluation:
    figures = {figure.name: to_json(figure) for figure in result.figures}
    with store.write() as session:
        identity = insert_evaluation(session, values, figures, result.frames)
        return read_evaluation(session, identity)


@dataclass(frozen=True)
class SourcesEvaluationRequest:
    """What to evaluate, its sets still to be read or found.

    Attributes:
        request: Without sets and version; they are filled in.
        predictions: Predicted boxes and cameras, or empty.
        reference: Reference boxes, which the boxes of the dataset are measured against; or empty.
        version: Name, id or hash of a frozen version; None: the dataset as it is now.
    """

    request: EvaluationRequest
    predictions: PredictionFiles
    reference: PredictionFiles
    version: str | None = None

    def refuse_unused_options(self) -> None:
        """Refuse options that nothing uses.

        Raises:
            InputError: Naming the option.
        """
        self.predictions.refuse_unused_options()
        self.reference.refuse_unused_options("reference-")
        refuse_group_rule_beside_version(self.request.groups, self.version)


@dataclass(frozen=True)
class EvaluatedSources:
    """An evaluation, and the sets that were made or found for it."""

    evaluation: StoredEvaluation
    sets: tuple[PredictionSet, ...]


def evaluate_sources(
    store: Store,
    dataset: str | int,
    wanted: SourcesEvaluationRequest,
    *,
    actor: str,
    progress: ReportProgress | None = None,
) -> EvaluatedSources:
    """Read predictions and reference boxes into sets, and evaluate them.

    Args:
        store: The database.
        dataset: Name or id.
        wanted: What to evaluate.
        actor: Who asks.
        progress: Called as the evaluation goes on.

    Raises:
        NotFoundError: There is no such dataset, version, file or set.
        InputError: A file cannot be used, or nothing is left to evaluate.
    """
    wanted.refuse_unused_options()
    pinned = None if wanted.version is None else find_version(store, dataset, wanted.version).id
    found, drawn = (
        None
        if source.names_no_file
        else read_or_find_prediction_set(store, dataset, source, actor=actor)
        for source in (wanted.predictions, wanted.reference)
    )
    request = replace(
        wanted.request,
        predictions=None if found is None else found.id,
        careful=None if drawn is None else drawn.id,
        version=pinned,
    )
    evaluation = run_evaluation(store, dataset, request, actor=actor, progress=progress)
    return EvaluatedSources(evaluation, tuple(item for item in (found, drawn) if item is not None))


def read_or_find_prediction_set(
    store: Store, dataset: str | int, source: PredictionFiles, *, actor: str
) -> PredictionSet:
    """The set of a source: read from its files now, or found under its name.

    Files that were read before, in the same way, give the set that they gave then.

    Raises:
        NotFoundError: There is neither a file nor a set of that name.
        InputError: A file cannot be used.
    """
    if source.path is not None and not source.path.exists():
        if source.cameras is not None:
            raise NotFoundError(
                f"there is no file {source.path}",
                hint="--cameras needs a file of boxes beside it, not the name of a set.",
            )
        return find_predictions(store, dataset, str(source.path), or_file=True)
    return add_predictions(store, dataset, None, source, actor=actor)
