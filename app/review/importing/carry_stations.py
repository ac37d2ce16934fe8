"""Carry, static cameras: those of this installation merged with those of another."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

from app.review.editing.lineage import StationLineage, station_lineage
from app.review.editing.shared_stations import SharedStations
from app.review.editing.upstream import KIND
from app.review.importing.carry_merge import CONFLICT, FOLLOW, UPSTREAM, Side, decide
from app.review.importing.carry_parse import CarriedStation
from app.review.importing.ingest import IngestReport, Origin
from app.store.clock import now
from app.store.codecs import station_to_json
from app.store.digest import station_digest
from app.store.findings import replace_station_finding, station_finding
from app.store.group_revisions import refresh_inputs_hashes
from app.store.imports import shared_stations
from app.store.log import Entry, append
from app.store.queue import refresh_queue
from app.store.session import Session
from app.store.stations import StoredStation, groups_of_station, save_station


def merge_stations(
    session: Session, origin: Origin, carried: Iterable[CarriedStation], report: IngestReport
) -> None:
    """Bring static cameras up to what another installation made of them."""
    for item in carried:
        stored = _stored(session, origin.dataset_id, item.station.key)
        if stored is None or _is_upstream(session, stored, item):
            shared = SharedStations(session, origin.dataset_id, origin.source, origin.actor)
            shared.follow([item.base])
            report.changed += len(shared.changed)
            report.findings += len(shared.kept)
            stored = _stored(session, origin.dataset_id, item.station.key)
        assert stored is not None
        report.changed += _merge(session, origin, stored, item, report)


def _is_upstream(session: Session, stored: StoredStation, item: CarriedStation) -> bool:
    """Whether the other's dataset brought what this one's never did."""
    base = station_digest(item.base)
    if base == stored.source_digest:
        return False
    return base not in station_lineage(session, stored).states


def _merge(
    session: Session,
    origin: Origin,
    stored: StoredStation,
    item: CarriedStation,
    report: IngestReport,
) -> bool:
    lineage = station_lineage(session, stored)
    here = Side(stored.digest, stored.source_digest, lineage.states)
    there = Side(station_digest(item.station), station_digest(item.base), item.states)
    decision = decide(here, there)
    if decision in (FOLLOW, UPSTREAM):
        _follow(session, origin, stored, item, lineage, _sentence(decision, stored))
    elif decision == CONFLICT:
        return _note(session, origin, stored, lineage, _sentence(decision, stored), report)
    return decision in (FOLLOW, UPSTREAM)


def _sentence(decision: str, stored: StoredStation) -> str | None:
    key = stored.station.key
    if decision == CONFLICT:
        return (
            f"another installation edited the lines or the camera of {key} too; what is here stays"
        )
    if decision == UPSTREAM:
        return (
            f"another installation edited the lines or the camera of {key} on another state of "
            "the dataset; its edit is in place now"
        )
    return None


def _follow(
    session: Session,
    origin: Origin,
    stored: StoredStation,
    item: CarriedStation,
    lineage: StationLineage,
    sentence: str | None,
) -> None:
    station = stored.station.with_said(item.station)
    save_station(session, stored, station)
    replace_station_finding(session, stored.id, KIND, sentence)
    _log(session, origin, replace(stored, station=station), lineage, sentence, list(item.log))
    groups = groups_of_station(session, stored.id)
    refresh_inputs_hashes(session, groups)
    refresh_queue(session, groups)


def _note(
    session: Session,
    origin: Origin,
    stored: StoredStation,
    lineage: StationLineage,
    sentence: str | None,
    report: IngestReport,
) -> bool:
    """Save a conflict, unless it is known; whether it was new."""
    if station_finding(session, stored.id) == sentence:
        return False
    # A revision of its own, as every entry of the log about a station makes one.
    save_station(session, stored, stored.station)
    replace_station_finding(session, stored.id, KIND, sentence)
    _log(session, origin, stored, lineage, sentence, [])
    refresh_queue(session, groups_of_station(session, stored.id))
    report.findings += 1
    return True


def _log(
    session: Session,
    origin: Origin,
    stored: StoredStation,
    lineage: StationLineage,
    sentence: str | None,
    carried: list[object],
) -> None:
    station, base = station_to_json(stored.station), station_to_json(lineage.base)
    body = {
        "source": origin.source,
        "station": station,
        "base": None if base == station else base,
        "kept": sentence,
        "carried": carried,
    }
    entry = Entry("station", origin.actor, now(), body, origin.dataset_id, station_id=stored.id)
    append(session, [entry])


def _stored(session: Session, dataset_id: int, key: str) -> StoredStation | None:
    return next(iter(shared_stations(session, dataset_id, key)), None)
