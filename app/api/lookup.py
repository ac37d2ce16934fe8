"""From the id in an address to the group, view or station that it means."""

from __future__ import annotations

from dataclasses import dataclass

from sqlalchemy import select

from app.errors import NotFoundError
from app.soccer.group import Media
from app.store.models import GroupModel, StationModel, ViewModel
from app.store.session import Store


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
    statement = (
        select(
            ViewModel.group_id,
            ViewModel.key,
            ViewModel.media_path,
            ViewModel.media_member,
            ViewModel.media_frame,
            StationModel.flipped,
            StationModel.width,
            StationModel.shared,
            GroupModel.key.label("group_key"),
        )
        .join(StationModel, StationModel.id == ViewModel.station_id)
        .join(GroupModel, GroupModel.id == ViewModel.group_id)
        .where(ViewModel.id == view_id)
    )
    with store.read() as session:
        row = session.execute(statement).one_or_none()
    if row is None:
        raise NotFoundError(f"there is no view {view_id}")
    media = None
    if row.media_path is not None:
        media = Media(row.media_path, row.media_member, row.media_frame)
    return FoundView(
        row.group_id, row.key, media, row.flipped, row.width, row.group_key, row.shared
    )
