"""Picture files: pictures from folders, zips and files, decoded where they can take nobody down."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

import numpy as np
import numpy.typing as npt

from app.config import Settings
from app.datasets.file_tree import Limits
from app.datasets.frame_names import IMAGE_SUFFIXES
from app.datasets.report import Report
from app.datasets.trees import opened_tree
from app.errors import ReviewError
from app.store.frames import LIMITS
from app.store.media import decode_picture
from app.worker_process import WorkerEnded, WorkerProcess


class UniqueNames:
    """Names of frames, none given twice: ``a.jpg`` and ``a.png`` are ``a`` and ``a_2``."""

    def __init__(self) -> None:
        self._given: set[str] = set()

    def name(self, stem: str) -> str:
        """The stem, or the stem and the first number that no frame has yet."""
        frame, count = stem, 1
        while frame in self._given:
            count += 1
            frame = f"{stem}_{count}"
        self._given.add(frame)
        return frame


@dataclass(frozen=True)
class PictureFile:
    """One picture, or why there is none.

    Attributes:
        stem: Name of the frame, with its folders where it lies in some.
        image: Red green blue, shape (H, W, 3); None where ``problem`` says why.
        problem: A sentence.
    """

    stem: str
    image: npt.NDArray[np.uint8] | None
    problem: str | None = None


def read_pictures(
    sources: Sequence[Path], settings: Settings, report: Report
) -> Iterator[PictureFile]:
    """Every picture of some folders, zips and files, in the order of their names.

    Each is decoded in a process with limits; one that cannot be is told, and the next one read.

    Args:
        report: Hears what could not be opened at all.
    """
    with closing(WorkerProcess(LIMITS)) as worker:
        for source in sources:
            with opened_tree(source, report, Limits.of(settings)) as tree:
                if tree is None:
                    continue
                for name in tree.names():
                    if PurePosixPath(name).suffix.lower() not in IMAGE_SUFFIXES:
                        continue
                    stem = str(PurePosixPath(name).with_suffix(""))
                    try:
                        data = tree.read_bytes(name)
                        image = worker.run(decode_picture, data, settings, PurePosixPath(name).name)
                        yield PictureFile(stem, image)
                    except ReviewError as error:
                        yield PictureFile(stem, None, error.message)
                    except WorkerEnded as error:
                        yield PictureFile(stem, None, f"{PurePosixPath(name).name} {error}")


def picture_stems(sources: Sequence[Path], settings: Settings) -> list[str]:
    """Stems of every picture of some folders, zips and files; nothing is decoded."""
    stems: list[str] = []
    for source in sources:
        with opened_tree(source, Report(), Limits.of(settings)) as tree:
            if tree is None:
                continue
            places = [PurePosixPath(name) for name in tree.names()]
        stems += [
            str(place.with_suffix("")) for place in places if place.suffix.lower() in IMAGE_SUFFIXES
        ]
    return stems
