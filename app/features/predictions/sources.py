"""Prediction sources: files to read predictions from, or a set of them that is there already."""

from __future__ import annotations

from dataclasses import dataclass, replace

from app.db.store import Store
from app.errors import NotFoundError
from app.features.predictions.evaluation_run import EvaluationRequest, check_groups, run_evaluation
from app.features.predictions.queries import PredictionSet, StoredEvaluation
from app.features.predictions.reader import PredictionFiles
from app.features.predictions.service import add_predictions, find_predictions
from app.features.versions.service import find_version
from app.progress import ReportProgress


@dataclass(frozen=True)
class SourcesRequest:
    """What to evaluate, its sets still to be read or found.

    Attributes:
        request: Without sets and version; they are filled in.
        predictions: Predicted boxes and cameras, or empty.
        careful: Boxes drawn with care, by which the truth itself is measured; or empty.
        version: Name, id or hash of a frozen version; None: the dataset as it is now.
    """

    request: EvaluationRequest
    predictions: PredictionFiles
    careful: PredictionFiles
    version: str | None = None

    def check(self) -> None:
        """Refuse options that nothing uses.

        Raises:
            InputError: Naming the option.
        """
        self.predictions.check()
        self.careful.check("careful-")
        check_groups(self.request.groups, self.version)


@dataclass(frozen=True)
class EvaluatedSources:
    """An evaluation, and the sets that were made or found for it."""

    evaluation: StoredEvaluation
    sets: tuple[PredictionSet, ...]


def evaluate_sources(
    store: Store,
    dataset: str | int,
    wanted: SourcesRequest,
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
    wanted.check()
    pinned = None if wanted.version is None else find_version(store, dataset, wanted.version).id
    found, drawn = (
        None if source.is_empty else prediction_set(store, dataset, source, actor=actor)
        for source in (wanted.predictions, wanted.careful)
    )
    request = replace(
        wanted.request,
        predictions=None if found is None else found.id,
        careful=None if drawn is None else drawn.id,
        version=pinned,
    )
    evaluation = run_evaluation(store, dataset, request, actor=actor, progress=progress)
    return EvaluatedSources(evaluation, tuple(item for item in (found, drawn) if item is not None))


def prediction_set(
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
            raise NotFoundError(f"there is no file {source.path}")
        return find_predictions(store, dataset, str(source.path))
    return add_predictions(store, dataset, None, source, actor=actor)
