"""Readers: what becomes of files that somebody brings, and what must not.

The only way out besides success is an error of the tree, with a sentence; problems name their
file. Neither takes more processor time or memory than a few sound files could.
"""

from __future__ import annotations

import resource
import signal
import tempfile
import traceback
import warnings
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import Any

from app.config import Settings
from app.db.store import Store
from app.errors import DatasetFormatError, ReviewError
from app.evaluation.frame import FrameNameIndex, NamedFrame
from app.evaluation.prediction_files import read_predicted_cameras, read_predictions
from app.features.imports.sources import (
    STATIC,
    ImportSource,
    _open_issia_folder,
    _read_groups,
    import_source,
)
from app.features.policies.service import MAX_CHARACTERS, policy_from_yaml
from app.features.queue.query import parse_query
from app.formats.export_formats import FORMATS, WriteOptions, write_format
from app.formats.export_record import ExportRecord
from app.formats.file_tree import ImportLimits
from app.formats.guess_format import guess_format
from app.formats.output import open_output_folder
from app.formats.report import ReaderReport
from app.json_text import json_text
from app.media.files import read_encoded_frame
from app.soccer.choices import ImportFormat
from app.soccer.group import Group, Media
from app.soccer.policy import PAPER
from app.solving.solve import solve_group
from app.terminal.options import read_text
from tests.cameras import SIZE
from tests.fuzz.case import Case

IMPORTS: tuple[str, ...] = ImportFormat.__args__
KINDS = (
    *IMPORTS, "predictions-coco", "predictions-yolo", "predictions-csv", "policy", "text", "query",
    "image", "video",
)  # fmt: skip
SECONDS, MEMORY = 20.0, 1024 * 2**20
"""Processor time for one case, and memory beyond what the process had before it."""
CLOCK_SECONDS = 90.0
"""Whatever waits for something does not take processor time."""
GROUPS = 3
"""Groups of a case that are solved and written again."""
LIMITS = ImportLimits(members=1000, file_bytes=8 * 2**20, total_bytes=64 * 2**20)


class TooSlowError(BaseException):
    """A case took more time than it may."""


@dataclass(frozen=True)
class Fault:
    """What must not be.

    Attributes:
        place: What was raised and where, the same for the same mistake.
        told: The traceback.
    """

    place: str
    told: str


class Readers:
    """Everything that reads, over one database that keeps nothing."""

    def __init__(self, home: Path):
        self.settings = Settings(home=home)
        self.store = Store.open(self.settings)
        match = "league/2015-2016/2015-08-08 - 14-00 Home 3 - 1 Away"
        frames = [
            NamedFrame(number, f"{match}/7.png", view, match, SIZE)
            for number, view in enumerate(("7.png", "7_1.png"), 1)
        ]
        static = NamedFrame(9, "358", "cam3", "issia", SIZE, station="cam3")
        self.names = FrameNameIndex.of([*frames, static])

    def close(self) -> None:
        """Close the database."""
        self.store.close()

    def try_out(self, case: Case, *, whole: bool = True) -> Fault | None:
        """Read a case; None where nothing happened that must not.

        Args:
            case: Its files.
            whole: Whether what was read is also solved and written in every format.
        """
        with tempfile.TemporaryDirectory(prefix="touchline-case-") as name:
            try:
                folder = Path(name, "files")
                folder.mkdir()
                path = case.write(folder)
            except (OSError, ValueError):
                return None  # No disk holds a file of that name.
            try:
                with _bounded(), warnings.catch_warnings():
                    warnings.simplefilter("ignore")
                    self._read(case.kind, path, whole)
            except ReviewError as error:
                return _unsaid(error)
            except (Exception, TooSlowError) as error:
                return _fault(error)
        return None

    def _read(self, kind: str, path: Path, whole: bool) -> None:
        guess_format(path)
        if kind in IMPORTS:
            self._import(kind, path, whole)
        elif kind.startswith("predictions-"):
            found = read_predictions(
                path, kind.removeprefix("predictions-"), self.names, limits=LIMITS
            )
            _require_said(found.report)
            with suppress(ReviewError):
                read_predicted_cameras(path, self.names, limits=LIMITS)
        elif kind == "policy":
            policy_from_yaml(read_text(path, MAX_CHARACTERS))
        elif kind == "query":
            parse_query(read_text(path, 2000))
        elif kind == "text":
            read_text(path, 2000)
        else:
            frame = 1 if kind == "video" else None
            for width in (None, 20):
                read_encoded_frame(Media(str(path), frame=frame), width, False, self.settings)

    def _import(self, kind: str, path: Path, whole: bool) -> None:
        source = ImportSource(kind, path, name="upload")
        done = import_source(self.store, "fuzz", source, self.settings, dry_run=True)
        _require_said(done.report)
        json_text(done.to_report_values()).encode()
        done.explain_nothing_imported()
        if whole and kind not in ("cameras", "touchline"):
            _use(list(islice(_groups_of(source, self.settings), GROUPS)))


def _groups_of(source: ImportSource, settings: Settings) -> Iterator[Group]:
    report = ReaderReport()
    if source.format in STATIC:
        return _open_issia_folder(source, report, LIMITS).groups()
    return _read_groups(source, settings, report, LIMITS)


def _use(groups: list[Group]) -> None:
    """Solve what was read, and write it in every format that has room for it."""
    records = [ExportRecord(group, solve_group(group, PAPER), "accepted") for group in groups]
    for name in FORMATS:
        if name == "touchline" or not records:
            continue
        with (
            tempfile.TemporaryDirectory(prefix="touchline-case-") as out,
            suppress(ReviewError),
            open_output_folder(Path(out, "export")) as root,
        ):
            write_format(root, records, WriteOptions(name, everything=True))


def _require_said(report: ReaderReport) -> None:
    for problem in report.problems:
        if not problem.path or not problem.problem:
            raise AssertionError(f"a problem without a file or a sentence: {problem!r}")


def _unsaid(error: ReviewError) -> Fault | None:
    if error.message and not (isinstance(error, DatasetFormatError) and not error.path):
        return None
    return Fault(f"{type(error).__name__} without a sentence or a file", repr(error))


def _fault(error: BaseException) -> Fault:
    frames = [
        frame for frame in traceback.extract_tb(error.__traceback__) if "/app/" in frame.filename
    ]
    place = frames[-1] if frames else None
    where = "?" if place is None else f"{place.filename.partition('/app/')[2]}:{place.name}"
    return Fault(f"{type(error).__name__} in {where}", "".join(traceback.format_exception(error)))


@contextmanager
def _bounded() -> Iterator[None]:
    """Bounds on processor time, time and memory for what is done inside."""

    def ended(number: int, _frame: Any) -> None:
        what = f"{SECONDS} seconds of processor time"
        raise TooSlowError(
            f"more than {what if number == signal.SIGPROF else f'{CLOCK_SECONDS} seconds'}"
        )

    before = {number: signal.signal(number, ended) for number in (signal.SIGPROF, signal.SIGALRM)}
    used = int(Path("/proc/self/statm").read_text().split()[5]) * resource.getpagesize()
    soft, hard = resource.getrlimit(resource.RLIMIT_DATA)
    resource.setrlimit(resource.RLIMIT_DATA, (used + MEMORY, hard))
    signal.setitimer(signal.ITIMER_PROF, SECONDS)
    signal.setitimer(signal.ITIMER_REAL, CLOCK_SECONDS)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
        signal.setitimer(signal.ITIMER_REAL, 0)
        resource.setrlimit(resource.RLIMIT_DATA, (soft, hard))
        for number, handler in before.items():
            signal.signal(number, handler)
