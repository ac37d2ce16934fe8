"""Sources: which reader reads which format, and what an import says about it in the end."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from app.config import Settings
from app.datasets.archive import Limits
from app.datasets.camera_json import read_cameras
from app.datasets.issia import IssiaOptions, open_issia
from app.datasets.report import Report
from app.datasets.sn_calibration import read_sn_calibration
from app.datasets.soccernet_v3 import read_soccernet_v3
from app.review.cameras import ingest_cameras
from app.review.ingest import IngestReport, ingest
from app.review.spare import SpareFrame, ingest_spare
from app.soccer.annotation import Extras
from app.soccer.frames import ImageSize
from app.soccer.group import Group
from app.store.session import Store

ACTOR = "local"


@dataclass(frozen=True)
class Source:
    """Files of one format, and what they do not say themselves.

    Attributes:
        format: ``soccernet-v3``, ``issia``, ``sn-calibration`` or ``cameras``.
        path: Folder, zip or file.
        lines: ISSIA: folder of the line files of the static cameras.
        calibration: Which calibration counts where there are both.
        frame_offset: ISSIA: number in the XGTF file minus number in video, also by camera.
        flipped: ISSIA: cameras whose frames are mirrored.
        size: Size of the annotated images.
    """

    format: str
    path: Path
    size: ImageSize
    lines: Path | None = None
    calibration: str = "given"
    frame_offset: int | Mapping[int, int] = 8
    flipped: frozenset[int] = frozenset()


@dataclass(frozen=True)
class Imported:
    """What the files held (``report``) and what became of it (``result``)."""

    report: Report
    result: IngestReport

    @property
    def something(self) -> bool:
        """Whether anything of the files is in the dataset now."""
        return self.result.new + self.result.changed + self.result.unchanged > 0

    def values(self) -> dict[str, Any]:
        """Everything that there is to tell, as plain values."""
        return {
            "read": self.report.read,
            "imported": self.report.imported,
            "new": self.result.new,
            "changed": self.result.changed,
            "unchanged": self.result.unchanged,
            "missing": self.result.missing,
            "findings": self.result.findings,
            "counts": dict(self.report.counts),
            "problems": [
                {
                    "file": problem.path,
                    "record": problem.record,
                    "field": problem.field,
                    "problem": problem.problem,
                }
                for problem in self.report.problems
            ],
            "more_problems": self.report.dropped,
            "remarks": list(self.result.problems),
        }


def import_source(
    store: Store,
    dataset: str,
    source: Source,
    settings: Settings,
    progress: Callable[[int], None] | None = None,
) -> Imported:
    """Bring the files into a dataset, which is made when there is none of that name."""
    report, limits = Report(), Limits.of(settings)
    if source.format == "cameras":
        cameras = read_cameras(source.path, report, limits)
        result = ingest_cameras(store, dataset, cameras, source=str(source.path), actor=ACTOR)
        return Imported(report, result)
    if source.format == "issia":
        return _import_issia(store, dataset, source, report, limits, progress)
    groups = _groups(source, report, limits)
    result = _ingest(store, dataset, source, groups, progress)
    return Imported(report, result)


def _groups(source: Source, report: Report, limits: Limits) -> Iterator[Group]:
    if source.format == "soccernet-v3":
        return read_soccernet_v3(source.path, report, limits)
    return read_sn_calibration(
        source.path, source.size, report, calibration=source.calibration, limits=limits
    )


def _import_issia(
    store: Store,
    dataset: str,
    source: Source,
    report: Report,
    limits: Limits,
    progress: Callable[[int], None] | None,
) -> Imported:
    options = IssiaOptions(
        frame_offset=source.frame_offset,
        flipped=source.flipped,
        lines=source.lines,
        calibration=source.calibration,
        size=source.size,
    )
    folder = open_issia(source.path, options, report, limits)
    result = _ingest(store, dataset, source, folder.groups(), progress)
    frames = (
        SpareFrame(item.camera, str(item.frame), Extras(boxes=item.boxes))
        for item in folder.persons()
    )
    ingest_spare(store, dataset, frames, source=str(source.path), actor=ACTOR)
    return Imported(report, result)


def _ingest(
    store: Store,
    dataset: str,
    source: Source,
    groups: Iterator[Group],
    progress: Callable[[int], None] | None,
) -> IngestReport:
    return ingest(store, dataset, groups, source=str(source.path), actor=ACTOR, progress=progress)
