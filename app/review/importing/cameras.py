"""Cameras on their own: calibrations that are attached to the views and stations they name."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import PurePosixPath

from app.geometry.camera import Camera
from app.review.datasets.dataset import get_dataset_head
from app.review.importing.ingest import IngestReport, attempt
from app.store.clock import now
from app.store.codecs import camera_to_json
from app.store.group_revisions import bump_groups, refresh_inputs_hashes
from app.store.log import Entry, append
from app.store.queue import refresh_queue
from app.store.session import Session
from app.store.stations import groups_of_station, read_stations, save_station
from app.store.store import Store
from app.store.views import dataset_views

BATCH = 50
"""Cameras a transaction."""


@dataclass(frozen=True)
class _Place:
    """A station that a name means; ``group`` is that of its only view, None when shared."""

    station: int
    group: int | None


def ingest_cameras(
    store: Store,
    dataset: str,
    cameras: Mapping[str, Camera],
    *,
    source: str,
    actor: str,
    dry_run: bool = False,
) -> IngestReport:
    """Attach given calibrations to what they name; attaching them again changes nothing.

    A name is the key of a static camera (``cam3``), the stem of a view (``7_1``, ``00002``), or
    ``<match>/<stem>`` or ``<group>/<stem>`` where a stem alone means several.

    Args:
        store: The database.
        dataset: Name of an existing dataset.
        cameras: By name, as ``datasets.camera_json.read_cameras`` reads them.
        source: Where they come from, for the log.
        actor: Who imports.
        dry_run: Say what would happen, and keep nothing.

    Returns:
        ``changed`` and ``unchanged`` count cameras; ``problems`` name those that fit nothing.

    Raises:
        NotFoundError: There is no such dataset.
    """
    report, found = IngestReport(), get_dataset_head(store, dataset)
    with store.read() as session:
        places = _places(session, found.id)
    known = []
    for name in sorted(cameras):
        fitting = places.get(name, [])
        if len(fitting) == 1:
            known.append((fitting[0], cameras[name]))
        else:
            views = "several views have" if fitting else "no view has"
            report.problems.append(f'camera "{name}": {views} this name')
    for start in range(0, len(known), BATCH):
        with attempt(store, keep=not dry_run) as session:
            batch = known[start : start + BATCH]
            _attach_batch(session, found.id, batch, source, actor, report)
    return report


def _places(session: Session, dataset_id: int) -> dict[str, list[_Place]]:
    places: dict[str, list[_Place]] = {}
    for row in dataset_views(session, dataset_id):
        stem = str(PurePosixPath(row.key).with_suffix(""))
        own = row.group.removeprefix(f"{row.match}/") if row.match else row.group
        names = (
            {row.station}
            if row.shared
            # An export of views that several groups have puts the group before each.
            else {stem, f"{row.match}/{stem}", f"{row.group}/{stem}", f"{row.match}/{own}/{stem}"}
        )
        place = _Place(row.station_id, None if row.shared else row.group_id)
        for name in names:
            known = places.setdefault(name, [])
            if place not in known:
                known.append(place)
    return places


def _attach_batch(
    session: Session,
    dataset_id: int,
    batch: Sequence[tuple[_Place, Camera]],
    source: str,
    actor: str,
    report: IngestReport,
) -> None:
    stations = read_stations(session, [place.station for place, _ in batch])
    touched: set[int] = set()
    entries, at = [], now()
    for place, camera in batch:
        stored = stations[place.station]
        if stored.station.given == camera:
            report.unchanged += 1
            continue
        station = stored.station.with_given(camera)
        save_station(session, stored, station, source=None if stored.edited else station)
        body = {"source": source, "given": camera_to_json(camera)}
        entries.append(Entry("camera", actor, at, body, dataset_id, place.group, place.station))
        if place.group is not None:
            bump_groups(session, [place.group], at)
        touched.update(groups_of_station(session, place.station))
        report.changed += 1
    append(session, entries)
    refresh_inputs_hashes(session, sorted(touched))
    refresh_queue(session, sorted(touched))
