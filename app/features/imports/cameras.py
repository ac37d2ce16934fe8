"""Cameras on their own: calibrations that are attached to the views and stations they name."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

from app.db.log import NewLogEntry, append_entries
from app.db.session import Session, now
from app.db.store import Store
from app.features.datasets.service import get_dataset_head
from app.features.groups.revision_queries import bump_group_revisions, refresh_inputs_hashes
from app.features.groups.view_queries import (
    StoredView,
    list_dataset_views,
    list_groups_of_station,
    read_stations,
    save_station,
)
from app.features.imports.ingest import IngestReport, open_import_session
from app.features.queue.refresh_queries import refresh_queue
from app.formats.camera_json import COVARIANCE, covariance_from_json
from app.formats.frame_names import (
    HolderFolders,
    compose_name,
    list_possible_export_keys,
    strip_image_suffix,
    view_file_path,
    with_export_key,
)
from app.formats.report import ReaderReport
from app.geometry.camera import Camera
from app.soccer.codec import camera_to_json, covariance_to_json
from app.soccer.frames import ImageSize
from app.soccer.group import Group, Station, View
from app.soccer.picture import size_centred_on_principal_point

BATCH = 50
"""Cameras a transaction."""
EXAMPLES = 3
"""Names of views that are shown where a camera has none of them."""


@dataclass(frozen=True)
class NamedStation:
    """A station that a name means; ``group`` is that of its only view, None when shared."""

    station: int
    group: int | None
    match: str
    size: ImageSize


class GivenCamera(NamedTuple):
    """A camera for a station, and its covariance where that is known; None takes what was given away."""

    camera: Camera | None
    covariance: tuple[float, ...] | None


def import_given_cameras(
    store: Store,
    dataset: str,
    cameras: Mapping[str, Camera],
    *,
    source: str,
    actor: str,
    size: ImageSize | None = None,
    sizes: Mapping[str, ImageSize] | None = None,
    covariances: Mapping[str, Any] | None = None,
    top_folder: str = "",
    dry_run: bool = False,
    limit_report: ReaderReport | None = None,
) -> IngestReport:
    """Attach given calibrations to what they name; attaching them again changes nothing.

    A name is the key of a static camera (``cam3``), the stem of a view (``7_1``, ``00002``), or
    ``<match>/<stem>`` or ``<group>/<stem>`` where a stem alone means views of several matches. Views
    of one match that are called alike are one camera of a rig, and all of them get it but those that
    have a camera under a name of their own.

    Args:
        store: The database.
        dataset: Name of an existing dataset.
        cameras: By name, as ``formats.cameras.read_cameras`` reads them.
        source: Where they come from, for the log.
        actor: Who imports.
        size: Size of the images that the cameras were made for; None: that of each view.
        sizes: The same by name, where their files state it: they count before ``size``.
        covariances: How well they are known, by name, as ``read_cameras`` read it.
        top_folder: The folder in which a zip file holds everything; it names nothing.
        dry_run: Dry run: report what would happen, change nothing.
        limit_report: What the files hold; hears of cameras that fit nothing, or views of several matches.

    Returns:
        ``changed`` and ``unchanged`` count views and static cameras that a camera was attached to;
        ``problems`` name cameras that fit several views, or pictures of another size.

    Raises:
        NotFoundError: There is no such dataset.
    """
    found = get_dataset_head(store, dataset)
    report = IngestReport(left_out=ReaderReport() if limit_report is None else limit_report)
    with store.read() as session:
        places = _StationNames.read(session, found.id, top_folder)
    named: list[tuple[str, list[NamedStation]]] = []
    for name in sorted(cameras):
        try:
            named.append((name, places.find_stations(name)))
        except ValueError as error:
            report.left_out.add_problem_at(source, f'camera "{name}"', None, str(error))
    known: list[tuple[NamedStation, GivenCamera]] = []
    taken: dict[int, str] = {}
    # A camera of one view counts before that of its rig.
    for name, meant in sorted(named, key=lambda item: len(item[1])):
        fitting = [place for place in meant if taken.setdefault(place.station, name) == name]
        if not fitting:
            problem = f'is a second camera of its view; "{taken[meant[0].station]}" is used'
            report.left_out.add_problem_at(source, f'camera "{name}"', None, problem)
            continue
        if len(fitting) > 1:
            report.problems.append(f'camera "{name}" belongs to {len(fitting)} views of this name')
        stated = (sizes or {}).get(name)
        if stated is not None and size not in (None, stated):
            report.problems.append(
                f'camera "{name}": its file says {stated.width} x {stated.height}, and --size is '
                f"{size.width}x{size.height}; the size in the file is used"
            )
        made_for = stated or size
        report.problems.extend(_iterate_size_warnings(name, cameras[name], fitting, made_for))
        record = {COVARIANCE: (covariances or {}).get(name)}
        for place in fitting:
            covariance = covariance_from_json(record, cameras[name], made_for or place.size)
            camera = _scale_camera(cameras[name], made_for, place.size)
            known.append((place, GivenCamera(camera, covariance)))
    for start in range(0, len(known), BATCH):
        with open_import_session(store, keep=not dry_run) as session:
            batch = known[start : start + BATCH]
            attach_cameras(session, found.id, batch, source, actor, report)
    return report


class _StationNames:
    """The stations of a dataset by the names that files of cameras may have.

    Args:
        rows: The views of the dataset.
        top_folder: A folder that names nothing.
    """

    def __init__(self, rows: Sequence[StoredView], top_folder: str):
        self._places: dict[str, dict[int, NamedStation]] = {}
        self._telling: set[str] = set()
        """Names that tell the group or the match, whatever stands before them."""
        self._top = top_folder
        self._holders = HolderFolders(name for row in rows for name in (row.group, row.match))
        for row in rows:
            self._add(row, _list_own_names(row), f"{row.match}/" if row.match else None)
        own = set(self._places)
        for row in rows:
            self._add(row, _list_names_with_group(row) - own, "")

    @classmethod
    def read(cls, session: Session, dataset_id: int, top_folder: str) -> _StationNames:
        """The names of a dataset."""
        return cls(list_dataset_views(session, dataset_id), compose_name(top_folder))

    def _add(self, row: StoredView, names: Iterable[str], telling: str | None) -> None:
        """Add names of a view; those that begin with ``telling`` tell the group or the match."""
        size = ImageSize(row.width, row.height)
        place = NamedStation(row.station_id, None if row.shared else row.group_id, row.match, size)
        for name in names:
            self._places.setdefault(name, {}).setdefault(place.station, place)
            if telling is not None and name.startswith(compose_name(telling)):
                self._telling.add(name)

    def find_stations(self, name: str) -> list[NamedStation]:
        """What a name means.

        A folder that names neither group nor match does not matter where it holds files of any of
        them (``HolderFolders``), only one view has the name, or the name is a place on a disk.

        Raises:
            ValueError: It means nothing, or views of several matches; a message for people.
        """
        is_on_disk = name.startswith("/")
        parts = compose_name(name.lstrip("/")).split("/")
        for start in range(len(parts)):
            known = "/".join(parts[start:])
            if known not in self._places:
                continue
            found = list(self._places[known].values())
            folders = parts[parts[0] == self._top : start]
            others = self._holders.find_other_folders(folders)
            # Three of them may be the league, season and match of another one.
            alone = len(found) == 1 and (len(folders) < 3 or not found[0].match)
            if others and not (is_on_disk or alone or known in self._telling):
                raise ValueError(f'folder "{others[-1]}" names no group or match')
            if len(matches := sorted({place.match for place in found})) > 1:
                raise ValueError(
                    f'views of {len(matches)} matches have this name; call it "{matches[0]}/{known}",'
                    " or like the other match"
                )
            return found
        raise ValueError(f"no view has this name{self._format_example_names()}")

    def _format_example_names(self) -> str:
        names = [f'"{name}"' for name in sorted(self._places) if "/" not in name]
        more = " and more" if len(names) > EXAMPLES else ""
        return f"; views are called {', '.join(names[:EXAMPLES])}{more}" if names else ""


def _list_own_names(row: StoredView) -> set[str]:
    """Stem of a view or key of a static camera, alone and with the folders of its match before it."""
    stem = row.station if row.shared else strip_image_suffix(row.key)
    folders = row.match.split("/") if row.match else []
    names = ("/".join((*folders[start:], stem)) for start in range(len(folders) + 1))
    return set(map(compose_name, names))


def _list_names_with_group(row: StoredView) -> set[str]:
    """Names that tell the group of a view, and those of its files in an export beside others."""
    station = Station(row.station, ImageSize(row.width, row.height), shared=row.shared)
    view = View(row.key, station)
    group = Group(row.group, (view,), match=row.match)
    _, *called = list_possible_export_keys(group, view)
    names = {view_file_path(group, with_export_key(view, key)) for key in called}
    return set(map(compose_name, (*names, f"{row.group}/{strip_image_suffix(row.key)}")))


def _scale_camera(camera: Camera, made_for: ImageSize | None, size: ImageSize) -> Camera:
    if made_for is None or made_for == size:
        return camera
    return camera.scaled(size.width / made_for.width, size.height / made_for.height)


def _iterate_size_warnings(
    name: str, camera: Camera, fitting: Sequence[NamedStation], made_for: ImageSize | None
) -> Iterator[str]:
    """What to say of a camera whose principal point is the middle of another size than was said."""
    for size in sorted({made_for or place.size for place in fitting}, key=lambda it: it.width):
        other = size_centred_on_principal_point(camera, size)
        if other is not None:
            x, y = camera.principal_point
            yield (
                f'camera "{name}": its principal point ({x:g}, {y:g}) is the middle of '
                f"{other.width} x {other.height}, not of {size.width} x {size.height}; import it again "
                f"with --size {other.width}x{other.height}"
            )


def attach_cameras(
    session: Session,
    dataset_id: int,
    batch: Sequence[tuple[NamedStation, GivenCamera]],
    source: str,
    actor: str,
    report: IngestReport,
) -> None:
    """Attach cameras to stations of a dataset, inside the caller's write transaction.

    Args:
        source: Where they come from, for the log.
        report: Counts ``changed`` and ``unchanged``.
    """
    stations = read_stations(session, [place.station for place, _ in batch])
    touched: set[int] = set()
    entries, at = [], now()
    for place, given in batch:
        stored = stations[place.station]
        # A file that says nothing of its camera takes nothing of what is known of it.
        known = given.covariance in (None, stored.station.given_covariance)
        if stored.station.given == given.camera and known:
            report.unchanged += 1
            continue
        station = stored.station.with_given_camera(*given)
        save_station(session, stored, station, source=None if stored.edited else station)
        shown = None if given.camera is None else camera_to_json(given.camera)
        body = {"source": source, "given": shown}
        if given.covariance is not None:
            body["covariance"] = covariance_to_json(given.covariance)
        entries.append(
            NewLogEntry("camera", actor, at, body, dataset_id, place.group, place.station)
        )
        if place.group is not None:
            bump_group_revisions(session, [place.group], at)
        touched.update(list_groups_of_station(session, place.station))
        report.changed += 1
    append_entries(session, entries)
    refresh_inputs_hashes(session, sorted(touched))
    refresh_queue(session, sorted(touched))
