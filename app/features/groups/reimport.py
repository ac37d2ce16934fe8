"""What becomes of a stored group or station when its dataset is imported again."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

from app.db.log import NewLogEntry, append_entries, list_station_entries
from app.db.session import Session, now
from app.features.findings.queries import find_station_finding, replace_station_finding
from app.features.groups.insert_queries import NewRows
from app.features.groups.queries import StoredGroup
from app.features.groups.revision_queries import has_same_station, refresh_inputs_hashes
from app.features.groups.view_queries import StoredStation, list_groups_of_station, save_station
from app.features.imports.queries import list_shared_stations
from app.features.queue.refresh_queries import refresh_queue
from app.media.files import is_same_picture
from app.soccer.codec import (
    camera_from_log_entry,
    station_digest,
    station_from_json,
    station_to_json,
    view_digest,
)
from app.soccer.group import Group, Station, View

KIND = "upstream_changed"


@dataclass(frozen=True)
class KeptEditFinding:
    """Something a person edited and the dataset changed too: the person's version stayed."""

    view: str | None
    sentence: str


@dataclass(frozen=True)
class MergedGroup:
    """A group after its dataset changed.

    ``base`` is the group as it would be had nobody edited it; ``dropped`` are keys of views that went.
    """

    group: Group
    base: Group
    kept: tuple[KeptEditFinding, ...]
    dropped: tuple[str, ...] = ()


@dataclass(frozen=True)
class MergedStation:
    """A station after its dataset changed; ``base`` as in ``MergedGroup``."""

    station: Station
    base: Station
    kept: KeptEditFinding | None


def update_group_from_dataset(stored: StoredGroup, incoming: Group) -> MergedGroup:
    """The stored group brought up to the incoming one, but for what a person edited.

    Shared stations are the incoming group's own; they are followed once, elsewhere.
    """
    if stored.edited and _shows_another_match(stored.group, incoming):
        return _keep_group_of_another_match(stored, incoming)
    dropped: list[str] = []
    views: list[View] = []
    bases: list[View] = []
    kept: list[KeptEditFinding] = []
    for view in incoming.views:
        result, base, noticed = _update_view_from_dataset(stored, view)
        views.append(result)
        bases.append(base)
        kept.extend(noticed)
    for view in stored.group.views:
        if incoming.view(view.key) is not None:
            continue
        if not stored.is_view_edited(view.key):
            dropped.append(view.key)
        else:
            views.append(view)
            bases.append(view)
            sentence = f"{view.key} is no longer in the imported files; it is kept because a person edited it"
            kept.append(KeptEditFinding(view.key, sentence))
    return MergedGroup(
        replace(incoming, views=tuple(views)),
        replace(incoming, views=tuple(bases)),
        tuple(kept),
        tuple(dropped),
    )


def _shows_another_match(old: Group, new: Group) -> bool:
    """Whether a group of the same key is one of another match, or of another split of no match."""
    if old.match and new.match:
        differs = old.match != new.match
    else:
        differs = bool(old.split and new.split) and old.split != new.split
    return differs and not any(
        _is_same_picture(view, other)
        for view in old.views
        if (other := new.view(view.key)) is not None
    )


def shows_another_picture(old: Group, new: Group) -> bool:
    """Whether a view of two groups of the same key has another picture, where that is known."""
    return any(
        _is_same_picture(view, other) is False
        for view in old.views
        if (other := new.view(view.key)) is not None
    )


def shows_another_scene(old: Group, new: Group) -> bool:
    """Whether two groups of the same key are of different scenes: neither a picture nor what is annotated
    is the same. Pictures of which nothing is known tell nothing, other than a match or a split does."""
    pairs = [(view, other) for view in old.views if (other := new.view(view.key)) is not None]
    said = [(_list_annotations(view), _list_annotations(other)) for view, other in pairs]
    if any(old == new and any(old) for old, new in said):
        return False
    same = {_is_same_picture(view, other) for view, other in pairs}
    return True not in same and (False in same or _shows_another_match(old, new))


def _list_annotations(view: View) -> list[object]:
    """What tells one picture of a camera from another: of a static camera the balls alone. Many pictures show none."""
    own = [] if view.station.shared else [view.station.lines, view.station.given]
    return [[ball for ball in view.balls if ball.center is not None], *own]


def _is_same_picture(old: View, new: View) -> bool | None:
    if old.media is None or new.media is None:
        return None
    return is_same_picture(old.media, new.media)


def _shows_another_frame(old: View, new: View) -> bool:
    return (
        old.media is not None
        and new.media is not None
        and old.media.path == new.media.path
        and old.media.frame != new.media.frame
    )


def _keep_group_of_another_match(stored: StoredGroup, incoming: Group) -> MergedGroup:
    what = "match" if stored.group.match and incoming.match else "split"
    kept = [
        KeptEditFinding(
            view.key,
            f"the imported files have a group of another {what} under the same name; this group is kept "
            "because a person edited it",
        )
        for view in stored.group.views
        if stored.is_view_edited(view.key)
    ]
    return MergedGroup(stored.group, incoming, tuple(kept))


def update_station_from_dataset(
    stored: StoredStation,
    incoming: Station,
    source: Station | None = None,
    *,
    lines_left: bool = False,
) -> MergedStation:
    """The stored station brought up to the incoming one, unless a person edited it.

    A calibration that was imported on its own stays when the dataset brings none. So do the
    lines of a shared station, and which calibration counts: they come from files of their own,
    which an import may leave out.

    Args:
        stored: The station as it is.
        incoming: The station as the dataset brings it now.
        source: The station as the dataset brought it before, where that is known.
        lines_left: Whether its lines were left aside on purpose.
    """
    if (
        not lines_left
        and incoming.shared
        and not incoming.lines
        and source is not None
        and source.lines
    ):
        incoming = replace(incoming, lines=source.lines, calibration=source.calibration)
    # Under an edit the stored camera may be a person's; that of the dataset is the source's.
    brought = stored.station if source is None else source
    if incoming.given is None and brought.given is not None:
        incoming = incoming.with_given_camera(brought.given, brought.given_covariance)
    if not stored.edited:
        return MergedStation(incoming, incoming, None)
    kept = None
    if station_digest(incoming) not in (stored.digest, stored.source_digest):
        sentence = f"the imported files have new lines or a new camera for {incoming.key}; the edits are kept"
        kept = KeptEditFinding(None, sentence)
    # What no edit can touch follows all the same.
    station = incoming.with_annotations_of(stored.station)
    return MergedStation(station, incoming, kept)


def _update_view_from_dataset(
    stored: StoredGroup, view: View
) -> tuple[View, View, list[KeptEditFinding]]:
    old = stored.group.view(view.key)
    if old is None or not has_same_station(stored, view):
        return view, view, []
    edited = stored.is_view_edited(view.key)
    if edited and _is_same_picture(old, view) is False:
        sentence = (
            f"the imported files have another picture for {view.key}; the picture on which a person "
            "worked is kept with its annotations"
        )
        station = view.station if view.station.shared else old.station
        return replace(old, station=station), view, [KeptEditFinding(view.key, sentence)]
    kept: list[KeptEditFinding] = []
    if edited and _shows_another_frame(old, view):
        # All cameras of an instant move together, so this one follows, too.
        sentence = (
            f"the imported files show another frame of the video in {view.key}; check the edits, which "
            "are kept"
        )
        kept.append(KeptEditFinding(view.key, sentence))
    result = base = view
    if not view.included and not old.included:
        # Saying why is no edit of what is solved; the dataset's word counts where it has one.
        result = replace(view, left_out=view.left_out or old.left_out)
    if view.key in stored.edited_views:
        result = replace(view, balls=old.balls, included=old.included, left_out=old.left_out)
        # Neither what it said before nor what the person says.
        if view_digest(view) not in stored.view_digests[view.key]:
            sentence = (
                f"the imported files have another ball in {view.key}; the edited ball is kept"
            )
            kept.append(KeptEditFinding(view.key, sentence))
    if result.balls == old.balls:
        # How noisy they are is no word of the dataset's.
        result = replace(result, noise=old.noise)
    if not view.station.shared:
        followed = update_station_from_dataset(stored.stations[view.key], view.station)
        result = replace(result, station=followed.station)
        base = replace(base, station=followed.base)
        if followed.kept is not None:
            kept.append(KeptEditFinding(view.key, followed.kept.sentence))
    return result, base, kept


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
        for stored in list_shared_stations(session, dataset_id):
            self._stored[stored.station.key] = stored
            self.ids[stored.station.key] = stored.id

    def insert_or_update(self, stations: Iterable[Station]) -> None:
        """Insert the shared ones among stations, or bring them up to what they are now."""
        for station in stations:
            if not station.shared or self._seen.get(station.key) is station:
                continue
            if station.key not in self._seen:
                self._insert_or_update_one(station)
            self._seen[station.key] = station

    def _insert_or_update_one(self, incoming: Station) -> None:
        stored = self._stored.get(incoming.key)
        if stored is None:
            self._insert_station(incoming)
            return
        source = self._find_station_as_imported(stored)
        followed = update_station_from_dataset(
            stored, incoming, source, lines_left=self._lines_left
        )
        changed = followed.station != stored.station
        if changed or station_digest(followed.base) != stored.source_digest:
            self._save_station(stored, followed)
            self.changed.append(incoming.key)

    def _find_station_as_imported(self, stored: StoredStation) -> Station | None:
        """A station as its dataset last brought it; under an edit only the log remembers."""
        if not stored.edited:
            return stored.station
        found = station = None
        for entry in list_station_entries(self._session, stored.id):
            if entry.kind == "station":
                station = station_from_json(entry.body["base"] or entry.body["station"])
            elif entry.kind == "camera" and station is not None:
                station = station.with_given_camera(*camera_from_log_entry(entry.body))
            if station is not None and station_digest(station) == stored.source_digest:
                found = station
        return found

    def _insert_station(self, station: Station) -> None:
        rows = NewRows(self._session, self._dataset_id)
        self.ids[station.key] = rows.add_station(station)
        rows.insert()
        self._log_station(self.ids[station.key], MergedStation(station, station, None), None)

    def _save_station(self, stored: StoredStation, followed: MergedStation) -> None:
        save_station(self._session, stored, followed.station, source=followed.base)
        self._log_station(stored.id, followed, self._save_station_finding(stored.id, followed))
        groups = list_groups_of_station(self._session, stored.id)
        refresh_inputs_hashes(self._session, groups)
        refresh_queue(self._session, groups)

    def _save_station_finding(self, station_id: int, followed: MergedStation) -> str | None:
        """Save what imports noticed about the station: this one, or earlier ones while it holds."""
        if followed.kept is not None:
            sentence: str | None = followed.kept.sentence
            self.kept.append(followed.station.key)
        elif station_digest(followed.station) != station_digest(followed.base):
            sentence = find_station_finding(self._session, station_id)
        else:
            sentence = None
        replace_station_finding(self._session, station_id, KIND, sentence)
        return sentence

    def _log_station(self, station_id: int, followed: MergedStation, kept: str | None) -> None:
        same = followed.base == followed.station
        body = {
            "source": self._source,
            "station": station_to_json(followed.station),
            "base": None if same else station_to_json(followed.base),
            "kept": kept,
        }
        entry = NewLogEntry(
            "station", self._actor, now(), body, self._dataset_id, station_id=station_id
        )
        append_entries(self._session, [entry])
