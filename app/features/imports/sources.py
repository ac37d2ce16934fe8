"""Sources: which reader reads which format, and what an import says about it in the end."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import partial
from typing import Any, get_args

from app.config import Settings
from app.db.store import Store
from app.errors import DatasetFormatError, InputError
from app.features.imports.cameras import import_given_cameras
from app.features.imports.ingest import (
    IngestReport,
    UnassignedFrame,
    import_groups,
    import_unassigned_frames,
)
from app.features.imports.picture_check import PictureCheck
from app.formats.cameras import read_cameras
from app.formats.coco_reader import read_coco
from app.formats.file_tree import ImportLimits, Root
from app.formats.frames_reader import parse_grouping_pattern, read_frame_list, read_frames
from app.formats.gamestate_reader import read_gamestate
from app.formats.guess_format import guess_format, guess_other_format, holds_only_videos
from app.formats.issia_3d import open_issia_3d
from app.formats.issia_reader import IssiaFolder, IssiaOptions, open_issia
from app.formats.parquet import read_parquet
from app.formats.report import ReaderReport
from app.formats.sn_calibration import DEFAULT_SIZE
from app.formats.sn_calibration_reader import read_sn_calibration
from app.formats.soccernet_v3_reader import read_soccernet_v3
from app.formats.soccernet_v3d_reader import read_soccernet_v3d
from app.media.images import check_size, read_header
from app.progress import ReportProgress
from app.soccer.annotation import Extras
from app.soccer.choices import CalibrationChoice, ImportFormat
from app.soccer.frames import ImageSize
from app.soccer.group import Group
from app.soccer.pitch import Pitch
from app.soccer.policy import PAPER, Policy
from app.wording import plural

FORMATS: tuple[str, ...] = get_args(ImportFormat)
STATIC = ("issia", "issia-3d")
_OF_GROUPS = tuple(name for name in FORMATS if name not in ("cameras", "touchline"))
USERS: Mapping[str, tuple[str, ...]] = {
    "calibration": (*STATIC, "soccernet-v3d", "sn-calibration", "gamestate", "coco"),
    "size": (*STATIC, "sn-calibration", "cameras"),
    "lines": STATIC,
    "frame_offset": ("issia",),
    "flipped": STATIC,
    "ball_category": ("coco",),
    "grouping": ("frames",),
    "propose": ("frames",),
    "frames": _OF_GROUPS,
    "policy": _OF_GROUPS,
}
"""Which formats use an option; any other would ignore it, so it is refused there."""
_TYPED = {
    "ball_category": "--ball-category",
    "frame_offset": "--frame-offset",
    "grouping": "--group-by",
    "propose": "--no-propose",
    "flipped": "--flip",
}


BALLS_ELSEWHERE = ("sn-calibration", "frames", "coco")
"""Formats that have no balls, or say themselves why there is none."""


@dataclass
class BallCounter:
    """Counts what groups bring on their way through an import."""

    groups: int = 0
    balls: int = 0
    classes: Counter[str] = field(default_factory=Counter)
    """Boxes that are no ball, by class."""

    def watch(self, groups: Iterable[Group]) -> Iterator[Group]:
        """The groups, each counted as it passes."""
        for group in groups:
            self.groups += 1
            for view in group.views:
                self.balls += len(view.balls)
                self.classes.update(str(box.get("class")) for box in view.extras.boxes)
            yield group

    def describe_missing_ball(self) -> str | None:
        """That the files bring no ball, with the classes that they have; None where they bring one."""
        if self.balls or not self.groups:
            return None
        most = ", ".join(
            f'"{name[:40]}" ({count:,})' for name, count in self.classes.most_common(12)
        )
        boxes = f"; its boxes are of {most}" if most else ""
        groups = f"{'the' if self.groups == 1 else 'any of'} {plural(self.groups, 'group')}"
        return f"no ball was read from {groups}{boxes}"


RECORDING_HINT = (
    "Bring it in with `touchline import video FILE --dataset NAME`, or on the page Recordings: its "
    "shots are found, and frames that you choose become groups."
)
FRAMES_HINT = (
    "Import them as frames: each picture becomes a group of one view, to be annotated here."
)


@dataclass(frozen=True)
class ImportSource:
    """Files of one format, and what they do not say themselves.

    Attributes:
        format: One of ``FORMATS``.
        path: Folder, zip or file.
        lines: ISSIA: folder of the line files of the static cameras.
        calibration: Which calibration counts where there are both: ``given``, as where nothing is
            said, or ``lines``. Said of static cameras, ``given`` leaves the lines of given ones aside.
        frame_offset: ISSIA: number in the XGTF file minus number in video, also by camera.
        flipped: ISSIA: cameras whose frames are mirrored.
        size: Size of the annotated images, for formats that do not say it; None: the usual one. Of
            ``cameras``: that of the images that they were made for; None: that of each view.
        frames: A list of where the frames lie (``app.formats.frames_reader``), where it is not beside
            the labels.
        name: What people call it; the log keeps it. Empty: the path.
        ball_category: COCO: name or id of the category that is the ball; empty: by its name.
        grouping: Pictures: which are one group (``frames_reader``); empty: each is one.
        propose: Pictures: whether cameras are proposed for them once they are imported.
        lines_name: What people call ``lines``; ``frames_name`` likewise.
    """

    format: str
    path: Root
    size: ImageSize | None = None
    lines: Root | None = None
    calibration: CalibrationChoice | None = None
    frame_offset: int | Mapping[int, int] = 8
    flipped: frozenset[int] = frozenset()
    frames: Root | None = None
    name: str = ""
    ball_category: str = ""
    grouping: str = ""
    propose: bool = True
    lines_name: str = ""
    frames_name: str = ""

    def require_used_options(self, *, policy: bool = False) -> None:
        """Refuse an option that the format does not use.

        Args:
            policy: Whether a policy was named for the dataset.

        Raises:
            InputError: Naming the option, and the formats that use it; or the grouping is none.
        """
        parse_grouping_pattern(self.grouping)
        usual = ImportSource(self.format, self.path)
        given = {
            name
            for name in USERS
            if name != "policy" and getattr(self, name) != getattr(usual, name)
        }
        for name in sorted(given | ({"policy"} if policy else set())):
            if self.format not in USERS[name]:
                raise InputError(
                    f"{self.format} does not use {_TYPED.get(name, f'--{name}')}",
                    hint=f"Leave it out. It is for {', '.join(sorted(USERS[name]))}.",
                    pointer="/policy" if name == "policy" else f"/options/{name}",
                )

    @property
    def label(self) -> str:
        """The name of the source in the log."""
        return self.name or str(self.path)

    def shown(self, text: str) -> str:
        """A text without the place of a source that has a name of its own."""
        if not self.name:
            return text
        places = [(str(self.path), "", self.name), (str(self.path.parent), "", self.name)]
        for path, name in ((self.lines, self.lines_name), (self.frames, self.frames_name)):
            if path is not None:
                called = name or path.name
                places.append((str(path), f"{called}/", called))
        # One may lie in the folder of another.
        for place, before, called in sorted(places, key=lambda item: len(item[0]), reverse=True):
            text = text.replace(f"{place}/", before).replace(place, called)
        return text

    @contextmanager
    def hide_places_in_errors(self) -> Iterator[None]:
        """Errors about files call them as people do, where the source has a name of its own."""
        try:
            yield
        except DatasetFormatError as error:
            path, problem = self.shown(error.path), self.shown(error.problem)
            raise DatasetFormatError(path, error.record, error.field, problem) from error


@dataclass(frozen=True)
class ImportResult:
    """What the files held (``report``) and what became of it (``result``)."""

    source: ImportSource
    report: ReaderReport
    result: IngestReport

    @property
    def imported_anything(self) -> bool:
        """Whether anything of the files is in the dataset now."""
        return self.result.new + self.result.changed + self.result.unchanged > 0

    @property
    def complete(self) -> bool:
        """Whether nothing was left out and no picture is missing."""
        report = self.report
        missing = self.result.without_picture or report.counts["views without frame"]
        return self.imported_anything and not (report.problems or report.dropped or missing)

    def explain_nothing_imported(self) -> tuple[str, str]:
        """Why nothing could be imported, naming the file, and what to do about it."""
        source = self.source
        problems = [problem.message for problem in self.report.problems] + self.result.problems
        name = source.shown(str(source.path))
        if (unannotated := self._describe_unannotated_source()) is not None:
            problem, hint = unannotated
            return f"nothing could be imported: {name} {problem}", hint
        sentence = f"nothing could be imported from {name} as {source.format}"
        if problems:
            first = source.shown(problems[0])
            sentence += f". The first of {len(problems)} problems: " if problems[1:] else ": "
            sentence += first
        look = guess_other_format(source.path, source.format)
        if look is not None and not (problems and look.is_advice_in_problem(problems[0])):
            return sentence, look.advice_sentence
        if self.report.read:
            return sentence, "Every record was left out; the report names each with its reason."
        return sentence, (
            f"Check that it is the right file or folder, and that it holds what {source.format} "
            "asks for (docs/formats.md)."
        )

    def _describe_unannotated_source(self) -> tuple[str, str] | None:
        """What a source is that nothing was read of, where it has no annotations; what to do."""
        if self.imported_anything:
            return None
        if holds_only_videos(self.source.path):
            return "holds a video, which is a recording", RECORDING_HINT
        if self.source.format != "frames" and guess_format(self.source.path) == "frames":
            return "holds pictures and no annotations", FRAMES_HINT
        return None

    def _list_skipped_problems(self) -> list[DatasetFormatError]:
        """What was left out, and why: of what has no annotations that alone."""
        unannotated = self._describe_unannotated_source()
        if unannotated is None:
            return self.report.problems
        return [DatasetFormatError(str(self.source.path), None, None, unannotated[0])]

    def to_report_values(self) -> dict[str, Any]:
        """Everything that there is to tell, as plain values."""
        shown = self.source.shown
        return {
            "outcome": "complete"
            if self.complete
            else "partial"
            if self.imported_anything
            else "nothing",
            "read": self.report.read,
            "imported": self.report.imported,
            "new": self.result.new,
            "changed": self.result.changed,
            "unchanged": self.result.unchanged,
            "missing": self.result.missing,
            "without_picture": self.result.without_picture,
            "findings": self.result.findings,
            "counts": dict(sorted(self.report.counts.items())),
            "skipped": [
                {
                    "file": shown(problem.path),
                    "record": problem.record,
                    "field": problem.field,
                    "problem": shown(problem.problem),
                }
                for problem in self._list_skipped_problems()
            ],
            "more_skipped": self.report.dropped,
            "remarks": [*map(shown, self.report.remarks), *self.result.problems],
        }


def import_source(
    store: Store,
    dataset: str,
    source: ImportSource,
    settings: Settings,
    progress: ReportProgress | None = None,
    *,
    actor: str = "local",
    dry_run: bool = False,
    policy: Policy | None = PAPER,
) -> ImportResult:
    """Bring the files into a dataset, which is made when there is none of that name.

    Killed anywhere and started again, it ends in the same state.

    Args:
        store: The database.
        dataset: Name.
        source: What to read, and how.
        settings: Caps on what is read.
        progress: Called with the number of groups done.
        actor: Who imports.
        dry_run: Dry run: report what would happen, change nothing.
        policy: Of a dataset that is made; None: as its first pictures suggest. A dataset that a
            ``touchline`` file makes has the policy of the file.

    Raises:
        InputError: The format does not use one of the options.
    """
    source.require_used_options()
    report, limits = ReaderReport(), ImportLimits.of(settings)
    if source.format == "cameras":
        sizes: dict[str, ImageSize] = {}
        covariances: dict[str, Any] = {}
        cameras = read_cameras(source.path, report, limits, sizes, covariances)
        result = import_given_cameras(
            store,
            dataset,
            cameras,
            source=source.label,
            actor=actor,
            size=source.size,
            sizes=sizes,
            covariances=covariances,
            top_folder=source.path.stem,
            dry_run=dry_run,
            limit_report=report,
        )
        return ImportResult(source, report, result)
    if source.format == "touchline":
        # It solves what it brings; who imports anything else need not load a solver.
        from app.features.imports.merge import merge_edits

        result = merge_edits(
            store,
            dataset,
            source.path,
            report,
            limits,
            source=source.label,
            actor=actor,
            progress=progress,
            dry_run=dry_run,
        )
        return ImportResult(source, report, result)
    folder = _open_issia_folder(source, report, limits) if source.format in STATIC else None
    groups = _read_groups(source, settings, report, limits) if folder is None else folder.groups()
    if source.frames is not None:
        groups = read_frame_list(source.frames, settings, report, limits).replace_listed_frames(
            iter(groups)
        )
    counts, check = BallCounter(), PictureCheck(report, settings, progress)
    result = import_groups(
        store,
        dataset,
        counts.watch(check.watch(groups)),
        source=source.label,
        actor=actor,
        progress=progress,
        dry_run=dry_run,
        policy=policy,
        limit_report=report,
        lines_left=folder is not None and source.calibration == "given",
    )
    result.problems += check.describe_differences()
    if dry_run or not result.new + result.changed + result.unchanged:
        result.findings += len(check.found)
    else:
        result.findings += check.save_shape_findings(store, dataset)
    if folder is not None and source.calibration is None:
        _report_contradicted_cameras(folder, dataset, source, report)
    if folder is not None and not dry_run:
        import_unassigned_frames(
            store, dataset, _iterate_unassigned_frames(folder), source=source.label, actor=actor
        )
    if source.format not in BALLS_ELSEWHERE and (sentence := counts.describe_missing_ball()):
        report.add_remark(sentence)
    return ImportResult(source, report, result)


def _read_picture_size(settings: Settings, data: bytes, name: str) -> ImageSize:
    header = read_header(data, name)
    check_size(header, settings, name)
    return ImageSize(header.width, header.height)


def _read_groups(
    source: ImportSource, settings: Settings, report: ReaderReport, limits: ImportLimits
) -> Iterator[Group]:
    path, calibration = source.path, source.calibration or "given"
    match source.format:
        case "soccernet-v3":
            return read_soccernet_v3(path, report, limits)
        case "soccernet-v3d":
            return read_soccernet_v3d(path, report, calibration=calibration, limits=limits)
        case "gamestate":
            return read_gamestate(path, report, calibration=calibration, limits=limits)
        case "coco":
            return read_coco(
                path,
                report,
                calibration=calibration,
                limits=limits,
                ball_category=source.ball_category,
            )
        case "parquet":
            return read_parquet(path, report, limits=limits)
        case "frames":
            size_of = partial(_read_picture_size, settings)
            return read_frames(path, size_of, report, limits, source.grouping)
        case _:
            size = source.size or DEFAULT_SIZE
            return read_sn_calibration(path, size, report, calibration=calibration, limits=limits)


def _open_issia_folder(
    source: ImportSource, report: ReaderReport, limits: ImportLimits
) -> IssiaFolder:
    options = IssiaOptions(
        frame_offset=source.frame_offset,
        flipped=source.flipped,
        lines=source.lines,
        calibration=source.calibration,
        size=source.size,
    )
    read = open_issia if source.format == "issia" else open_issia_3d
    return read(source.path, options, report, limits)


def _report_contradicted_cameras(
    folder: IssiaFolder, dataset: str, source: ImportSource, report: ReaderReport
) -> None:
    """Say of which static cameras the lines do not fit the given camera, and what to do."""
    from app.features.solutions.service import describe_contradiction, find_contradicted_cameras

    stations = {station.key: number for number, station in folder.stations.items()}
    off = find_contradicted_cameras(((one, Pitch()) for one in folder.stations.values()), PAPER)
    showing = [folder.tracks[stations[key]].balls.keys() for key in off]
    groups = {frame for track in folder.tracks.values() for frame in track.balls}
    if not off:
        return
    lines = "" if source.lines is None else f" --lines {source.lines}"
    command = (
        f"touchline import {source.format} {source.path} --dataset {dataset}{lines} "
        "--calibration given"
    )
    shown = len(set[int]().union(*showing))
    where = f"{shown:,} of {len(groups):,} groups show {'it' if len(off) == 1 else 'one of them'} and fail at the gate jac"
    report.add_remark(describe_contradiction(off, where, f"`{command}`"))


def _iterate_unassigned_frames(folder: IssiaFolder) -> Iterator[UnassignedFrame]:
    for item in folder.persons_without_ball():
        yield UnassignedFrame(item.camera, str(item.frame), Extras(boxes=item.boxes))
