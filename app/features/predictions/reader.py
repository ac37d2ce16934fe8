"""Prediction reader: files of predictions, read here or in a process with limits."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

from app.config import Settings
from app.errors import DatasetFormatError, InputError, TooLargeError
from app.evaluation.frame import FrameNameIndex
from app.evaluation.prediction_files import (
    AUTO,
    LoadedPredictedCameras,
    read_predicted_cameras,
    read_predictions,
)
from app.evaluation.prediction_run import LoadedPredictions
from app.features.imports.upload_queries import find_complete_upload_path
from app.formats.file_tree import ImportLimits
from app.soccer.frames import ImageSize
from app.worker_pool import WorkerPool
from app.worker_process import COUNTS, WorkerEnded, WorkerLimits

SECONDS, SILENCE = 120.0, 300.0
"""Of processor time, and by the clock, for one set: five million boxes take less."""
WAITING = 2
"""Sets that may wait while one is read; one more is told to come back."""
LIMITS_HINT = (
    "Bring the predictions in parts, have the operator raise TOUCHLINE_IMPORT_MEMORY, or use the "
    "command line (touchline evaluate), which has no limits. Nothing was kept."
)


@dataclass(frozen=True)
class PredictionFiles:
    """Files of predictions, and how to read them.

    Attributes:
        path: File, folder or zip of ball boxes or tracks, or None; of a command also the name of a set that is
            there.
        format: ``auto``, ``coco``, ``yolo``, ``csv`` or ``tracks``.
        images: The COCO document that numbers in ``coco`` results refer to, or None.
        cameras: Folder or zip of SoccerNet camera JSON, or None.
        category: The class that is the ball, where the file has several.
        size: Size of the images that boxes in pixels refer to, where that is not the annotated.
        cameras_size: The same for the cameras.
    """

    path: Path | None
    format: str = AUTO
    images: Path | None = None
    cameras: Path | None = None
    category: int | None = None
    size: ImageSize | None = None
    cameras_size: ImageSize | None = None

    @property
    def first(self) -> Path:
        """The file of the boxes, or of the cameras where there are none.

        Raises:
            InputError: There is neither.
        """
        found = self.path or self.cameras
        if found is None:
            raise InputError(
                "there are no predictions to import: give a file of boxes, a file of cameras, or"
                " both",
                pointer="/upload",
            )
        return found

    @property
    def names_no_file(self) -> bool:
        """Whether neither a file of boxes nor one of cameras is named."""
        return self.path is None and self.cameras is None

    def refuse_unused_options(self, prefix: str = "") -> None:
        """Refuse options of a command that nothing uses: those of files where none is read.

        Args:
            prefix: Before the names of its options, ``reference-``.

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
        if unused is not None and (self.path is None or not self.path.exists()):
            there = "there is none" if self.path is None else f'"{self.path}" is not a file'
            raise InputError(f"--{unused} needs a file of boxes, but {there}")
        if self.cameras_size is not None and self.cameras is None:
            raise InputError("--cameras-size needs predicted cameras, but no --cameras is given")


def resolve_uploaded_files(
    settings: Settings,
    how: PredictionFiles,
    path: str | None,
    images: str | None,
    cameras: str | None,
) -> PredictionFiles:
    """Uploaded files of predictions.

    Args:
        settings: Where uploads lie.
        how: How to read them.
        path: Id of the upload, or None; ``images`` and ``cameras`` likewise.

    Raises:
        NotFoundError: An upload is not there, or has expired.
    """

    def find_upload_path(upload: str | None) -> Path | None:
        return None if upload is None else find_complete_upload_path(settings, upload)

    return replace(
        how,
        path=find_upload_path(path),
        images=find_upload_path(images),
        cameras=find_upload_path(cameras),
    )


Found = tuple[LoadedPredictions, LoadedPredictedCameras]
Read = Callable[[PredictionFiles, FrameNameIndex, ImportLimits], Found]
"""Reads files, wherever that happens."""


def read_files(files: PredictionFiles, names: FrameNameIndex, limits: ImportLimits) -> Found:
    """Boxes and cameras of files, by the frames of a dataset."""
    boxes, cameras = LoadedPredictions(), LoadedPredictedCameras()
    if files.path is not None:
        boxes = read_predictions(
            files.path,
            files.format,
            names,
            category=files.category,
            size=files.size,
            images=files.images,
            limits=limits,
        )
    if boxes.tracks and files.cameras is not None:
        raise InputError(
            "ball tracks cannot be imported together with cameras",
            hint="Import the cameras as a separate set of predictions.",
            pointer="/cameras_upload",
        )
    if files.cameras is not None:
        cameras = read_predicted_cameras(
            files.cameras, names, size=files.cameras_size, limits=limits
        )
    return boxes, cameras


def _remove_folder_from_error(
    error: DatasetFormatError, files: PredictionFiles
) -> DatasetFormatError:
    """The same without the server's folders, which concern nobody who uploaded a file."""
    shown = error.path
    for path in (files.path, files.images, files.cameras):
        if path is not None:
            shown = shown.removeprefix(f"{path.parent}/")
    return DatasetFormatError(shown, error.record, error.field, error.problem)


class PredictionReader:
    """Reads files of somebody else in a process of its own, one set at a time."""

    def __init__(self, settings: Settings):
        worker_limits = WorkerLimits(settings.import_memory, SECONDS, SILENCE)
        counts = COUNTS["predictions"]
        self._pool = WorkerPool(worker_limits, 1, WAITING, "sets of predictions", counts)

    def read(self, files: PredictionFiles, names: FrameNameIndex, limits: ImportLimits) -> Found:
        """``read_files``, within limits.

        Raises:
            DatasetFormatError: A file is not what it should be; it is called by its name alone.
            TooLargeError: It went beyond the limits, or made the process crash.
            OverloadedError: Too many wait.
        """
        name = files.first.name

        def explain(error: WorkerEnded) -> TooLargeError:
            return TooLargeError(f"{name} {error}", hint=LIMITS_HINT)

        task = self._pool.submit(read_files, files, names, limits, explain=explain)
        try:
            found: Found = task.future.result()
        except DatasetFormatError as error:
            raise _remove_folder_from_error(error, files) from error
        for one in found:
            one.report.problems = [
                _remove_folder_from_error(problem, files) for problem in one.report.problems
            ]
        return found

    def close(self) -> None:
        """End the process."""
        self._pool.close()
