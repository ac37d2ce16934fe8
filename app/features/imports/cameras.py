"""Cameras on their own: calibrations that are attached to the views and stations they name."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

from app.db.log import NewLogEntry, append_entries
from app.db.session import Session, now
from app.db.store import Store
from app.features.datasets.service import get_dataset_head
from app.features.groups.revision_queries import bump_group_revisions, refresh_inputs_hashes
from app.features.groups.view_queries import (
    list_dataset_views,
    list_groups_of_station,
    read_stations,
    save_station,
)
from app.features.imports.ingest import IngestReport, open_import_session
from app.features.queue.refresh_queries import refresh_queue
from app.formats.camera_json import COVARIANCE, covariance_from_json
from app.formats.frame_names import compose_name, strip_image_suffix
from app.formats.report import ReaderReport
from app.geometry.camera import Camera
from app.soccer.codec import camera_to_json, covariance_to_json
from app.soccer.frames import ImageSize
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
    dry_run: bool = False,
    limit_report: ReaderReport | None = None,
) -> IngestReport:
    """Attach given calibrations to what they name; attaching them again changes nothing.

    A name is the key of a static camera (``cam3``), the stem of a view (``7_1``, ``00002``), or
    ``<match>/<stem>`` or ``<group>/<stem>`` where a stem alone means views of several matches. Views
    of one match that are called alike are one camera of a rig, and all of them get it.

    Args:
        store: The database.
        dataset: Name of an existing dataset.
        cameras: By name, as ``formats.cameras.read_cameras`` reads them.
        source: Where they come from, for the log.
        actor: Who imports.
        size: Size of the images that the cameras were made for; None: that of each view.
        sizes: The same by name, where their files state it: they count before ``size``.
        covariances: How well they are known, by name, as ``read_cameras`` read it.
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
        places = _read_stations_by_name(session, found.id)
    known: list[tuple[NamedStation, GivenCamera]] = []
    for name in sorted(cameras):
        fitting = _find_stations_of_name(places, name)
        matches = {place.match for place in fitting}
        if not fitting:
            problem = f"no view has this name{_format_example_names(places)}"
            report.left_out.add_problem_at(source, f'camera "{name}"', None, problem)
            continue
        if len(matches) > 1:
            problem = (
                f'views of {len(matches)} matches have this name; call it "{sorted(matches)[0]}/{name}", '
                "or like the other match"
            )
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


def _read_stations_by_name(session: Session, dataset_id: int) -> dict[str, list[NamedStation]]:
    places: dict[str, list[NamedStation]] = {}
    for row in list_dataset_views(session, dataset_id):
        stem = strip_image_suffix(row.key)
        own = row.group.removeprefix(f"{row.match}/") if row.match else row.group
        names = (
            {row.station}
            if row.shared
            # An export of views that several groups have puts the group before each.
            else {stem, f"{row.match}/{stem}", f"{row.group}/{stem}", f"{row.match}/{own}/{stem}"}
        )
        size = ImageSize(row.width, row.height)
        place = NamedStation(row.station_id, None if row.shared else row.group_id, row.match, size)
        for name in map(compose_name, names):
            known = places.setdefault(name, [])
            if place not in known:
                known.append(place)
    return places


def _find_stations_of_name(
    places: Mapping[str, list[NamedStation]], name: str
) -> list[NamedStation]:
    """What a name means; folders before it do not matter where no match could be one of them."""
    parts = compose_name(name).split("/")
    for start in range(len(parts)):
        found = places.get("/".join(parts[start:]), [])
        if found and (start == 0 or not any(place.match for place in found)):
            return found
    return []


def _format_example_names(places: Mapping[str, list[NamedStation]]) -> str:
    names = [f'"{name}"' for name in sorted(places) if "/" not in name]
    more = " and more" if len(names) > EXAMPLES else ""
    return f"; views are called {', '.join(names[:EXAMPLES])}{more}" if names else ""


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
