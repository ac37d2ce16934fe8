"""Prediction sources: files to read predictions from, or a set of them that is there already."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

from app.db.store import Store
from app.errors import InputError, NotFoundError
from app.evaluation.prediction_files import AUTO
from app.features.predictions.evaluation_queries import StoredEvaluation
from app.features.predictions.evaluation_run import EvaluationRequest, check_groups, run_evaluation
from app.features.predictions.queries import PredictionSet
from app.features.predictions.reader import PredictionFiles
from app.features.predictions.service import add_predictions, find_predictions
from app.features.versions.service import find_version
from app.progress import TellProgress
from app.soccer.frames import ImageSize


@dataclass(frozen=True)
class PredictionSource:
    """Ball boxes, cameras or both.

    Attributes:
        boxes: File, folder or zip of ball boxes, or the name of a set that is there; None: cameras
            alone.
        format: ``auto``, ``coco``, ``yolo`` or ``csv``.
        images: The COCO document that numbers in ``coco`` results refer to, or None.
        category: The class that is the ball, where the file has several.
        size: Size of the images that boxes in pixels refer to, where that is not the annotated.
        cameras: Folder or zip of SoccerNet camera JSON, or None.
        cameras_size: Size of the images of the cameras, where that is not the annotated.
    """

    boxes: str | None
    format: str = AUTO
    images: Path | None = None
    category: int | None = None
    size: ImageSize | None = None
    cameras: Path | None = None
    cameras_size: ImageSize | None = None

    @property
    def is_empty(self) -> bool:
        """Whether it names nothing at all."""
        return self.boxes is None and self.cameras is None

    def check(self, prefix: str = "") -> None:
        """Refuse options that nothing uses: those of files where none is read.

        Args:
            prefix: Before the names of its options, ``careful-``.

        Raises:
            InputError: Naming the option.
        """
        given = {
            f"{prefix}format": self.format != AUTO,
            "images": self.images is not None,
            f"{prefix}category": self.category is not None,
            f"{prefix}size": self.size is not None,
        }
        unused = next((name for name, is_given in given.items() if is_given), None)
        if unused is not None and (self.boxes is None or not Path(self.boxes).exists()):
            there = "there is none" if self.boxes is None else f'"{self.boxes}" is no file'
            raise InputError(f"--{unused} says how to read a file of boxes, and {there}")
        if self.cameras_size is not None and self.cameras is None:
            raise InputError("--cameras-size is the size of predicted cameras, and there are none")


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
    predictions: PredictionSource
    careful: PredictionSource
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
    asked: SourcesRequest,
    *,
    actor: str,
    progress: TellProgress | None = None,
) -> EvaluatedSources:
    """Read predictions and reference boxes into sets, and evaluate them.

    Args:
        store: The database.
        dataset: Name or id.
        asked: What to evaluate.
        actor: Who asks.
        progress: Called as the evaluation goes on.

    Raises:
        NotFoundError: There is no such dataset, version, file or set.
        InputError: A file cannot be used, or nothing is left to evaluate.
    """
    asked.check()
    pinned = None if asked.version is None else find_version(store, dataset, asked.version).id
    found, drawn = (
        None if source.is_empty else prediction_set(store, dataset, source, actor=actor)
        for source in (asked.predictions, asked.careful)
    )
    request = replace(
        asked.request,
        predictions=None if found is None else found.id,
        careful=None if drawn is None else drawn.id,
        version=pinned,
    )
    evaluation = run_evaluation(store, dataset, request, actor=actor, progress=progress)
    return EvaluatedSources(evaluation, tuple(item for item in (found, drawn) if item is not None))


def prediction_set(
    store: Store, dataset: str | int, source: PredictionSource, *, actor: str
) -> PredictionSet:
    """The set of a source: read from its files now, or found under its name.

    Files that were read before, in the same way, give the set that they gave then.

    Raises:
        NotFoundError: There is neither a file nor a set of that name.
        InputError: A file cannot be used.
    """
    path = None if source.boxes is None else Path(source.boxes)
    if path is not None and not path.exists():
        if source.cameras is not None:
            raise NotFoundError(f"there is no file {path}")
        return find_predictions(store, dataset, str(source.boxes))
    files = PredictionFiles(
        path,
        source.format,
        images=source.images,
        cameras=source.cameras,
        category=source.category,
        size=source.size,
        cameras_size=source.cameras_size,
    )
    return add_predictions(store, dataset, None, files, actor=actor)
