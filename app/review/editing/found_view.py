"""Found view: from the id of a view to the group that it belongs to and where its frame lies."""

from __future__ import annotations

from dataclasses import dataclass

from app.errors import NotFoundError
from app.soccer.media import Media
from app.store import views
from app.store.store import Store


@dataclass(frozen=True)
class FoundView:
    """Where a view belongs and where its frame lies."""

    group_id: int
    key: str
    media: Media | None
    flipped: bool
    width: int
    group_key: str
    static: bool
    """Whether the camera stands still for all views that share it."""


def find_view(store: Store, view_id: int) -> FoundView:
    """The view of that id.

    Raises:
        NotFoundError: There is none.
    """
    with store.read() as session:
        found = views.find_view(session, view_id)
    if found is None:
        raise NotFoundError(f"there is no view {view_id}")
    return FoundView(
        found.group_id,
        found.key,
        found.media,
        found.flipped,
        found.width,
        found.group,
        found.shared,
    )
