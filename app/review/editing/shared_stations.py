"""Shared stations during an import: inserted once, followed once, whatever the number of views."""

from __future__ import annotations

from collections.abc import Iterable

from app.review.editing.upstream import KIND, FollowedStation, follow_station
from app.soccer.group import Station
from app.store.clock import now
from app.store.codecs import camera_from_json, station_from_json, station_to_json
from app.store.digest import station_digest
from app.store.findings import replace_station_finding, station_finding
from app.store.group_revisions import refresh_inputs_hashes
from app.store.group_rows import NewRows
from app.store.imports import shared_stations
from app.store.log import Entry, append, station_entries
from app.store.queue import refresh_queue
from app.store.session import Session
from app.store.stations import StoredStation, groups_of_station, save_station


class SharedStations:
    """The shared stations of a dataset within one write transaction.

    ``changed`` names those that were there and changed, ``kept`` those with edits that stayed.
    ``lines_left``: what comes without lines has none, and does not keep those of before.
    """

    def __init__(
        self,
        session: Session,
        dataset_id: int,
        source: str,
        actor: str,
        *,
        lines_left: bool = False,
    ):
        self.changed: list[str] = []
        self.kept: list[str] = []
        self.ids: dict[str, int] = {}
        """By key."""
        self._session, self._dataset_id = session, dataset_id
        self._source, self._actor, self._lines_left = source, actor, lines_left
        self._stored: dict[str, StoredStation] = {}
        self._seen: dict[str, Station] = {}
        for stored in shared_stations(session, dataset_id):
            self._stored[stored.station.key] = stored
            self.ids[stored.station.key] = stored.id

    def follow(self, stations: Iterable[Station]) -> None:
        """Insert the shared ones among stations, or bring them up to what they are now."""
        for station in stations:
            if not station.shared or self._seen.get(station.key) is station:
                continue
            if station.key not in self._seen:
                self._follow(station)
            self._seen[station.key] = station

    def _follow(self, incoming: Station) -> None:
        stored = self._stored.get(incoming.key)
        if stored is None:
            self._insert(incoming)
            return
        source = self._source_of(stored)
        followed = follow_station(stored, incoming, source, lines_left=self._lines_left)
        changed = followed.station != stored.station
        if changed or station_digest(followed.base) != stored.source_digest:
            self._save(stored, followed)
            self.changed.append(incoming.key)

    def _source_of(self, stored: StoredStation) -> Station | None:
        """A station as its dataset last brought it; under an edit only the log remembers."""
        if not stored.edited:
            return stored.station
        found = said = None
        for entry in station_entries(self._session, stored.id):
            if entry.kind == "station":
                said = station_from_json(entry.body["base"] or entry.body["station"])
            elif entry.kind == "camera" and said is not None:
                said = said.with_given(camera_from_json(entry.body["given"]))
            if said is not None and station_digest(said) == stored.source_digest:
                found = said
        return found

    def _insert(self, station: Station) -> None:
        rows = NewRows(self._session, self._dataset_id)
        self.ids[station.key] = rows.add_station(station)
        rows.insert()
        self._log(self.ids[station.key], FollowedStation(station, station, None), None)

    def _save(self, stored: StoredStation, followed: FollowedStation) -> None:
        save_station(self._session, stored, followed.station, source=followed.base)
        self._log(stored.id, followed, self._note(stored.id, followed))
        groups = groups_of_station(self._session, stored.id)
        refresh_inputs_hashes(self._session, groups)
        refresh_queue(self._session, groups)

    def _note(self, station_id: int, followed: FollowedStation) -> str | None:
        """Save what imports noticed about the station: this one, or earlier ones while it holds."""
        if followed.kept is not None:
            sentence: str | None = followed.kept.sentence
            self.kept.append(followed.station.key)
        elif station_digest(followed.station) != station_digest(followed.base):
            sentence = station_finding(self._session, station_id)
        else:
            sentence = None
        replace_station_finding(self._session, station_id, KIND, sentence)
        return sentence

    def _log(self, station_id: int, followed: FollowedStation, kept: str | None) -> None:
        same = followed.base == followed.station
        body = {
            "source": self._source,
            "station": station_to_json(followed.station),
            "base": None if same else station_to_json(followed.base),
            "kept": kept,
        }
        entry = Entry("station", self._actor, now(), body, self._dataset_id, station_id=station_id)
        append(self._session, [entry])
