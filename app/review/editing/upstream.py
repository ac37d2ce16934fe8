"""Upstream: what becomes of a stored group (or station) when its dataset is imported again.

What nobody edited follows; what a person edited stays and is named in a finding.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from app.soccer.group import Group, Station, View
from app.store.digest import station_digest, view_digest
from app.store.group_revisions import keeps_station
from app.store.groups import StoredGroup
from app.store.stations import StoredStation

KIND = "upstream_changed"


@dataclass(frozen=True)
class KeptEdit:
    """Something a person edited and the dataset changed too: the person's version stayed."""

    view: str | None
    sentence: str


@dataclass(frozen=True)
class Followed:
    """A group after its dataset changed.

    ``base`` is the group as it would be had nobody edited it.
    """

    group: Group
    base: Group
    kept: tuple[KeptEdit, ...]


@dataclass(frozen=True)
class FollowedStation:
    """A station after its dataset changed; ``base`` as in ``Followed``."""

    station: Station
    base: Station
    kept: KeptEdit | None


def follow_group(stored: StoredGroup, incoming: Group) -> Followed:
    """The stored group brought up to the incoming one, but for what a person edited.

    Shared stations are the incoming group's own; they are followed once, elsewhere.
    """
    views: list[View] = []
    bases: list[View] = []
    kept: list[KeptEdit] = []
    for view in incoming.views:
        result, base, noticed = _follow_view(stored, view)
        views.append(result)
        bases.append(base)
        kept.extend(noticed)
    for view in stored.group.views:
        if incoming.view(view.key) is None and stored.is_edited(view.key):
            views.append(view)
            bases.append(view)
            sentence = f"{view.key} is gone from the dataset; a person had edited it, so it stays"
            kept.append(KeptEdit(view.key, sentence))
    return Followed(
        replace(incoming, views=tuple(views)), replace(incoming, views=tuple(bases)), tuple(kept)
    )


def follow_station(
    stored: StoredStation,
    incoming: Station,
    source: Station | None = None,
    *,
    lines_left: bool = False,
) -> FollowedStation:
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
        incoming = incoming.with_given(brought.given, brought.given_covariance)
    if not stored.edited:
        return FollowedStation(incoming, incoming, None)
    kept = None
    if station_digest(incoming) not in (stored.digest, stored.source_digest):
        sentence = f"the dataset has new lines or a new camera for {incoming.key}; edits stay"
        kept = KeptEdit(None, sentence)
    # What no edit can touch follows all the same.
    station = incoming.with_said(stored.station)
    return FollowedStation(station, incoming, kept)


def _follow_view(stored: StoredGroup, view: View) -> tuple[View, View, list[KeptEdit]]:
    old = stored.group.view(view.key)
    if old is None or not keeps_station(stored, view):
        return view, view, []
    kept: list[KeptEdit] = []
    result = base = view
    if not view.included and not old.included:
        # Saying why is no edit of what is solved; the dataset's word counts where it has one.
        result = replace(view, left_out=view.left_out or old.left_out)
    if view.key in stored.edited_views:
        result = replace(view, balls=old.balls, included=old.included, left_out=old.left_out)
        # Neither what it said before nor what the person says.
        if view_digest(view) not in stored.view_digests[view.key]:
            sentence = f"the dataset has another ball in {view.key}; the edited one stays"
            kept.append(KeptEdit(view.key, sentence))
    if result.balls == old.balls:
        # How noisy they are is no word of the dataset's.
        result = replace(result, noise=old.noise)
    if not view.station.shared:
        followed = follow_station(stored.stations[view.key], view.station)
        result = replace(result, station=followed.station)
        base = replace(base, station=followed.base)
        if followed.kept is not None:
            kept.append(KeptEdit(view.key, followed.kept.sentence))
    return result, base, kept
