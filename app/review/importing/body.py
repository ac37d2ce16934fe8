"""Import bodies: what the log keeps of an import of a group."""

from __future__ import annotations

from app.soccer.group import Group
from app.store.codecs import group_head_to_json, view_to_json
from app.store.groups import StoredGroup
from app.store.stored_json import Json


def places_of(stored: StoredGroup) -> dict[str, tuple[int, int]]:
    """Ids of each view and its station, by the view's key."""
    return {key: (stored.view_ids[key], stored.stations[key].id) for key in stored.view_ids}


def import_body(
    group: Group,
    base: Group | None,
    source: str,
    digest: str,
    places: dict[str, tuple[int, int]],
) -> dict[str, Json]:
    """What the log keeps of an import: the group whole, with the ids of its rows.

    ``base`` is left out where it is the group itself.
    """
    return {
        "source": source,
        "source_hash": digest,
        "group": _logged(group),
        "base": None if base is None or base == group else _logged(base),
        "ids": {key: list(pair) for key, pair in places.items()},
    }


def _logged(group: Group) -> Json:
    """A group in which a shared station is its key: the log has it in an entry of its own."""
    views = [
        view_to_json(view, view.station.key if view.station.shared else None)
        for view in group.views
    ]
    return {**group_head_to_json(group), "views": views}
