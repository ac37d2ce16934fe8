"""Export: what people accepted (or everything), as a folder or zip with a manifest."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import islice
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import get_args

from app.config import Settings
from app.db.json_columns import Json
from app.db.session import Session
from app.db.store import Store
from app.errors import InputError
from app.features.datasets.service import find_licence, read_dataset_head
from app.features.exports.source import (
    ExportImageWriter,
    ExportSource,
    Item,
    LiveSource,
    ReadPicture,
    VersionSource,
)
from app.features.groups.view_queries import list_frame_files
from app.features.imports.edits_export import FORMAT as CARRY
from app.features.imports.edits_export import export_edits
from app.features.imports.ingest import read_unassigned_persons
from app.features.tracks.export import TrackSource, list_frozen_track_records
from app.features.tracks.service import make_track_source
from app.features.versions.frozen_queries import decode_frozen_json, read_frozen
from app.features.versions.service import find_version
from app.formats.export_formats import (
    CONTENT,
    FORMATS,
    OTHER_SIZE,
    TRACKS,
    UNCHECKED,
    USERS,
    WITHOUT_PIXELS,
    WriteOptions,
    describe_box_settings,
    describe_missing_frames,
    describe_pictures_to_look_at,
    describe_view_settings,
    find_frame_path_rule,
    make_export_key_assigner,
    write_format,
)
from app.formats.export_record import ExportRecord
from app.formats.file_tree import Root
from app.formats.frame_names import ExportKeyAssigner, Outline
from app.formats.issia import FramePersons
from app.formats.manifest import UNKNOWN_LICENCE, Manifest, write_manifest
from app.formats.output import open_output
from app.formats.tracks_writer import TrackRecord
from app.formats.view_files import PutText, ViewFileBuffer
from app.media.frames import make_picture
from app.object_store.path import StoredPath, is_address
from app.progress import ReportProgress
from app.soccer.ball_boxes import BOX_KINDS
from app.soccer.choices import PicturesWritten, TrainingViews

IMAGES: tuple[str, ...] = get_args(PicturesWritten)
VIEWS: tuple[str, ...] = get_args(TrainingViews)
_NO_TRAINING_VIEW = (
    "A view that shows a ball needs a box of it: the annotated one, or the optimised one of a ball"
    " that another view confirms. Ask for optimised boxes (boxes: optimized), or for every view"
    " (views: all)."
)
TRIED = 100
"""Groups that are tried before an export is promised."""


@dataclass(frozen=True)
class ExportReport:
    """What was written.

    Attributes:
        groups: How many groups were to be written.
        counts: As the format counts: groups, views, balls, cameras ...; with images also
            ``pictures``, the files of frames that are there.
        left_out: Accepted groups that are not in it, by reason: ``stale`` (changed after the
            verdict), ``failing`` (a gate, and nobody overrode it), ``unsolved``.
        missing_images: Frames that could not be copied, with the reason.
    """

    out: Root
    format: str
    groups: int
    counts: Mapping[str, int]
    left_out: Mapping[str, int] = field(default_factory=dict)
    missing_images: tuple[str, ...] = ()


class _UnrepresentableError(InputError):
    """A format has no place for what the groups hold."""


@dataclass(frozen=True)
class FormatAvailability:
    """Whether a dataset can be written in a format; ``reason`` and ``hint`` where it cannot."""

    format: str
    reason: str | None = None
    hint: str | None = None


@dataclass(frozen=True)
class _ExportOptions:
    format: str
    everything: bool
    boxes: str = "optimized"
    images: str = "none"
    views: str = "valid"

    @property
    def includes_every_view(self) -> bool:
        """Whether training data hold every view."""
        return self.everything or self.views == "all"

    def require_options_apply(self) -> None:
        """Raises InputError where an option is given that the format does not use."""
        usual = _ExportOptions(self.format, self.everything)
        for name, formats in USERS.items():
            if self.format not in formats and getattr(self, name) != getattr(usual, name):
                raise InputError(
                    f"exports in the format {self.format} do not use --{name}",
                    hint=f"Leave it out. Only these formats use it: {', '.join(sorted(formats))}.",
                    pointer=f"/{name}",
                )

    def require_valid_options(self, out: Root) -> None:
        for name, value, choices in (
            ("format", self.format, FORMATS),
            ("boxes", self.boxes, BOX_KINDS),
            ("images", self.images, IMAGES),
            ("views", self.views, VIEWS),
        ):
            if value not in choices:
                raise InputError(
                    f'"{value}" is not possible for {name}; choose one of {", ".join(choices)}',
                    pointer=f"/{name}",
                )
        self.require_options_apply()
        if self.images == "link" and isinstance(out, StoredPath):
            raise InputError(
                "an object store cannot contain links to images; choose to copy the images"
            )
        if self.images == "link" and out.suffix.lower() == ".zip":
            raise InputError(
                "a zip file cannot contain links to images; export a folder, or choose to copy"
                " the images"
            )


def export_dataset(
    store: Store,
    dataset: str | int,
    format: str,  # noqa: A002
    out: Root,
    *,
    everything: bool = False,
    boxes: str = "optimized",
    images: str = "none",
    views: str = "valid",
    version: str | None = None,
    progress: ReportProgress | None = None,
    read: ReadPicture | None = None,
    beside: Path | None = None,
) -> ExportReport:
    """Write a dataset's accepted groups, or all groups, in a format that consumers read.

    Accepted means: the newest verdict accepts the group as it is now, and the policy passes it
    or a person overrode the gate with a reason. All is read from one snapshot of the database.

    Args:
        store: The database.
        dataset: Name or id.
        format: One of ``FORMATS``.
        out: Folder, or file that ends in .zip, on a disk or in an object store; appears whole or
            not at all.
        everything: Every group, whatever its verdict.
        boxes: ``optimized``, ``annotated`` or ``exact``: which ball box Labels-v3D.json, COCO,
            YOLO and Parquet hold. Other formats have no place for a chosen box.
        images: ``none``, ``copy`` or ``link`` (folders only); ``touchline`` holds none.
        views: ``valid`` or ``all``: whether COCO and YOLO, from which detectors learn, hold the
            views that annotate a ball and are in no valid pair. ``everything`` says all.
        version: Name, id or hash of a frozen version to export instead of the dataset as it is:
            the same bytes every time.
        progress: Called as groups are written, and as their files are packed.
        read: Reads frames; in this process by default.
        beside: After which its half written files are called, see ``open_output``.

    Raises:
        InputError: Nothing to export, the format does not use an option, or the groups do not fit it.
        StorageError: The disk refuses.
    """
    options = _ExportOptions(format, everything, boxes, images, views)
    options.require_valid_options(out)
    _require_no_version_conflict(format, everything, version)
    if format == CARRY:
        counts = export_edits(store, dataset, out, progress, beside)
        return ExportReport(out, CARRY, counts["groups"], counts)
    with store.read() as session:
        source = _open_source(session, store, dataset, options, version)
        with open_output(out, store.settings.exports, beside, progress) as root:
            frames = ExportImageWriter(
                root,
                images,
                read or _make_local_picture_reader(store),
                find_frame_path_rule(format),
            )
            names = make_export_key_assigner(format, source.outlines())
            run = _ExportRun(source, options, frames, names, progress)
            # A version is the same every time; unassigned frames are the dataset's as it is.
            run.tracks = _open_track_source(session, store.settings, source, options)
            if format == "parquet" and source.tracks:
                run.kept = list_frozen_track_records(_read_frozen_tracks(session, source))
            if format == "issia" and isinstance(source, LiveSource):
                run.unassigned = read_unassigned_persons(session, dataset)
            with _open_view_file_buffer(root, out) as put:
                counts = run.write(root, put)
            _require_content(source.dataset, format, counts)
            if images != "none" and "images_missing" not in counts:
                counts["pictures"] = frames.present_count
            counts |= _count_pictures_to_look_at(format, frames)
            write_manifest(root, run.manifest(counts), progress)
    left_out = source.left_out if isinstance(source, LiveSource) else {}
    return ExportReport(out, format, source.count, counts, left_out, tuple(frames.missing))


def _count_pictures_to_look_at(format: str, frames: ExportImageWriter) -> dict[str, int]:  # noqa: A002
    """Pictures that who uses the export has to know of; only what there is."""
    found = {
        OTHER_SIZE: 0 if format in WITHOUT_PIXELS else frames.other_size,
        UNCHECKED: frames.unchecked,
    }
    return {name: count for name, count in found.items() if count}


@contextmanager
def _open_view_file_buffer(root: Path, out: Root) -> Iterator[PutText | None]:
    """Where the files of single views go: on their way into a zip they wait together."""
    if out.suffix.lower() != ".zip":
        yield None
        return
    with ViewFileBuffer(root) as files:
        yield files.write_file


def require_exportable(
    store: Store,
    dataset: str | int,
    format: str,  # noqa: A002
    *,
    everything: bool = False,
    boxes: str = "optimized",
    images: str = "none",
    views: str = "valid",
    version: str | None = None,
) -> None:
    """Refuse, before anything is written, an export that cannot succeed.

    Its first groups are written to a folder that is thrown away, so that whatever a format has no
    place for is found by the writer itself.

    Raises:
        NotFoundError: There is no such dataset or version.
        InputError: Nothing to export, none of the images that are wanted is there, the format does
            not use an option, or the groups do not fit it; then the hint names those that they fit.
    """
    options = _ExportOptions(format, everything, boxes, images, views)
    options.require_options_apply()
    try:
        _require_exportable_in_format(store, dataset, options, version)
    except _UnrepresentableError as error:
        answers = list_format_availability(store, dataset, version)
        fitting = [answer.format for answer in answers if answer.reason is None]
        hint = f"These formats have room for it: {', '.join(fitting)}." if fitting else error.hint
        raise InputError(error.message, hint=hint) from error


def list_format_availability(
    store: Store, dataset: str | int, version: str | None = None
) -> list[FormatAvailability]:
    """Every format, and why a dataset, or a version of it, cannot be written in it.

    All groups are asked about, whatever their verdicts are: another verdict opens no format.

    Raises:
        NotFoundError: There is no such dataset or version.
    """
    answers = []
    options = _ExportOptions(CARRY, version is None, views="all")
    with store.read() as session:
        try:
            source = _FirstGroupsSource(_open_source(session, store, dataset, options, version))
        except InputError as error:
            return [FormatAvailability(format, error.message, error.hint) for format in FORMATS]  # noqa: A001
        for format in FORMATS:  # noqa: A001
            try:
                _require_no_version_conflict(format, options.everything, version)
                _require_groups_fit_format(session, store, source, replace(options, format=format))
            except InputError as error:
                answers.append(FormatAvailability(format, error.message, error.hint))
            else:
                answers.append(FormatAvailability(format))
    return answers


def _require_exportable_in_format(
    store: Store, dataset: str | int, options: _ExportOptions, version: str | None
) -> None:
    """``require_exportable`` of one format."""
    everything = options.everything or options.format == CARRY
    _require_no_version_conflict(options.format, options.everything, version)
    with store.read() as session:
        whole = _open_source(
            session, store, dataset, replace(options, everything=everything), version
        )
        _require_groups_fit_format(session, store, _FirstGroupsSource(whole), options)


def _require_groups_fit_format(
    session: Session, store: Store, source: _FirstGroupsSource, options: _ExportOptions
) -> None:
    """Raises InputError where the groups of a source cannot be written as asked for."""
    format = options.format  # noqa: A001
    if format == CARRY:
        return
    with TemporaryDirectory(prefix="touchline-") as folder:
        frames = ExportImageWriter(
            Path(folder), "none", _make_local_picture_reader(store), find_frame_path_rule(format)
        )
        with ViewFileBuffer(Path(folder)) as small:
            try:
                names = make_export_key_assigner(format, source.outlines())
                run = _ExportRun(source, options, frames, names, None)
                run.tracks = _open_track_source(
                    session, store.settings, source, options, try_only=True
                )
                counts = run.write(Path(folder), small.write_file)
            except InputError as error:
                raise _UnrepresentableError(error.message, hint=error.hint) from error
        if options.images != "none" and not frames.media:
            files = [] if source.is_whole_source else list_frame_files(session, source.dataset_id)
            _require_frames(source.dataset, files)
    if source.is_whole_source and run.tracks is None:
        _require_content(source.dataset, format, counts)


def _require_frames(dataset: str, files: Iterable[str]) -> None:
    """Raises InputError where images are wanted and no file of them is there."""
    if not any(is_address(file) or Path(file).exists() for file in files):
        raise InputError(
            f'no image file of "{dataset}" can be found, so the export cannot include images',
            hint="Export without images, or import the dataset again with its frames.",
            pointer="/images",
        )


def _require_no_version_conflict(format: str, everything: bool, version: str | None) -> None:  # noqa: A002
    """Raises InputError where a version is asked for together with what it cannot be."""
    if version is None:
        return
    if format == CARRY:
        raise InputError(
            "the format touchline always exports the whole dataset; choose another format to"
            " export a frozen version",
            pointer="/version",
        )
    if everything:
        raise InputError(
            "the option all cannot be combined with a frozen version, which exports exactly"
            " its own groups; leave all out, or export the dataset itself",
            pointer="/all",
        )


class _FirstGroupsSource:
    """The first groups of a source, which are read once for all formats that are tried."""

    def __init__(self, source: LiveSource | VersionSource):
        self._source = source
        self.dataset, self.version, self.licence = source.dataset, source.version, source.licence
        self.count, self.date = min(source.count, TRIED), source.date
        self.settings, self.stamp, self.policy = source.settings, source.stamp, source.policy
        self.dataset_id, self.tracks = source.dataset_id, source.tracks

    @property
    def is_whole_source(self) -> bool:
        """Whether there are no more."""
        return self.count == self._source.count

    @cached_property
    def _items(self) -> list[Item]:
        return list(islice(self._source.items(), self.count))

    @cached_property
    def _outlines(self) -> list[Outline]:
        return list(islice(self._source.outlines(), self.count))

    def items(self) -> Iterator[Item]:
        """As many as are tried."""
        return iter(self._items)

    def outlines(self) -> Iterator[Outline]:
        """The same groups with what names their files."""
        return iter(self._outlines)


def _make_local_picture_reader(store: Store) -> ReadPicture:
    return lambda media, width, flipped: make_picture(media, width, flipped, store.settings)


def _open_source(
    session: Session, store: Store, dataset: str | int, options: _ExportOptions, version: str | None
) -> LiveSource | VersionSource:
    found = read_dataset_head(session, dataset)
    if version is not None:
        frozen = find_version(store, found.id, version)
        return VersionSource(session, frozen)
    source = LiveSource(session, found, options.everything, options.format in TRACKS)
    source.require_any_group()
    return source


def _open_track_source(
    session: Session,
    settings: Settings,
    source: LiveSource | VersionSource | _FirstGroupsSource,
    options: _ExportOptions,
    *,
    try_only: bool = False,
) -> TrackSource | None:
    """What makes the tracks of an export; None where its format holds none."""
    if options.format not in TRACKS:
        return None
    frozen = None if source.tracks is None else _read_frozen_tracks(session, source)
    found = make_track_source(
        session, settings, source.dataset_id, source.dataset, source.policy, frozen
    )
    everything = options.everything or frozen is not None
    return replace(found, everything=everything, try_only=try_only)


def _read_frozen_tracks(
    session: Session, source: LiveSource | VersionSource | _FirstGroupsSource
) -> dict[str, Json]:
    """The tracks of a version by stretch, as they were frozen."""
    names = source.tracks or {}
    bodies = read_frozen(session, source.dataset_id, names.values())
    return {key: decode_frozen_json(bodies[name]) for key, name in names.items()}


class _ExportRun:
    """One export under way: streams records to a writer and notes what the manifest says."""

    def __init__(
        self,
        source: ExportSource,
        options: _ExportOptions,
        images: ExportImageWriter,
        names: ExportKeyAssigner,
        progress: ReportProgress | None,
    ):
        self._source, self._options = source, options
        self._images, self._names, self._progress = images, names, progress
        self._licences: set[str] = set()
        self._verdicts: Counter[str] = Counter()
        self._overrides: list[dict[str, str | None]] = []
        self._balls = 0
        self.unassigned: Iterable[FramePersons] = ()
        self.tracks: TrackSource | None = None
        self.kept: Sequence[TrackRecord] = ()

    def write(self, root: Path, put: PutText | None) -> dict[str, int]:
        """Write the format's files; returns its counts."""
        source, options = self._source, self._options
        policy = source.settings()
        provenance = {
            "dataset": source.dataset,
            "version": source.version,
            "policy": policy["policy"]["name"],
            "policy_hash": policy["policy_hash"],
            "date": source.date,
        }
        wanted = WriteOptions(
            options.format,
            options.everything,
            options.boxes,
            options.includes_every_view,
            provenance,
            self.unassigned,
            None if self.tracks is None else self.tracks.make_track_records,
            self.kept,
        )
        counts = write_format(root, self._iterate_records(), wanted, put)
        if self.tracks is None:
            counts.setdefault("balls", self._balls)
        return counts

    def manifest(self, counts: Mapping[str, int]) -> Manifest:
        """The manifest of this export."""
        source = self._source
        terms = " ".join(sorted(self._licences)) or UNKNOWN_LICENCE
        return Manifest(
            dataset=source.dataset,
            format=self._options.format,
            date=source.date,
            counts=counts,
            settings={
                **source.settings(),
                "images": self._options.images,
                **describe_box_settings(self._options.format, self._options.boxes),
                **describe_view_settings(self._options.format, self._options.includes_every_view),
                **describe_missing_frames(self._options.format, counts),
                **describe_pictures_to_look_at(counts),
            },
            licence=source.licence or terms,
            version=source.version,
            media=tuple(self._images.media),
            verdicts=dict(sorted(self._verdicts.items())),
            overrides=tuple(self._overrides),
            stamp={
                **source.stamp(),
                **({} if self.tracks is None else {"tracks": self.tracks.facts}),
            },
        )

    def _iterate_records(self) -> Iterator[ExportRecord]:
        options = self._options
        for place, (found, facts) in enumerate(self._source.items(), 1):
            record = found
            self._balls += sum(map(found.has_ball_3d, found.group.views))
            if options.format == "yolo":
                # A frame without its label would teach that it shows no ball: it stays out as well.
                record = found.keep_training_views(options.boxes, options.includes_every_view)
            if record.group.views:
                self._licences.add(find_licence(record.group.match))
                names = self._names.assign_keys(record.group, record.splits)
                self._images.add(record.group, facts, record.splits, names)
                self._note_verdict(record)
                # The writer counts what it leaves out.
                yield replace(found, frames=self._images.placed, names=names)
            else:
                yield found
            if self._progress is not None:
                self._progress(place, self._source.count)

    def _note_verdict(self, record: ExportRecord) -> None:
        """What the manifest says of a verdict."""
        self._verdicts[record.verdict] += 1
        if record.override is not None and record.verdict == "accepted":
            group, gate = record.group.key, record.override
            self._overrides.append({"group": group, "gate": gate, "reason": record.reason})


def _require_content(dataset: str, format: str, counts: Mapping[str, int]) -> None:  # noqa: A002
    """Raises InputError where a format has no place for anything that the groups hold."""
    count, what = CONTENT.get(format, ("groups", "group"))
    if not counts[count]:
        raise InputError(
            f'no group of "{dataset}" has a {what} for {format}, so there is nothing to export',
            hint=_NO_TRAINING_VIEW if format == "yolo" else None,
        )
