"""Saved views: queries of the queue under names that everybody on the dataset sees."""

from __future__ import annotations

from dataclasses import dataclass

from app.db.session import Session
from app.db.store import Store
from app.errors import ConflictError, InputError, NotFoundError
from app.features.datasets.service import strip_and_check_title
from app.features.people.visibility_queries import sees_independent_work
from app.features.queue.fields import query_reveals_hidden_work
from app.features.queue.queries import GroupListing
from app.features.queue.query import parse_query
from app.features.saved_views.queries import (
    SavedViewModel,
    delete_saved_view,
    find_saved_view,
    insert_saved_view,
    list_saved_views_of_dataset,
)
from app.json_text import Moment
from app.soccer.actors import LOCAL_USER, person_of_actor

MAX_VIEWS = 200
"""Of one dataset: a list that people read."""
MAX_OWN = 40
"""Of one person in one dataset: nobody takes all the room."""


@dataclass(frozen=True)
class SavedView:
    """A query under a name that everybody on the dataset sees.

    Attributes:
        q: A query of the queue.
        by: Who keeps it.
        groups: How many match now.
    """

    id: int
    name: str
    q: str
    by: str
    created: Moment
    groups: int


def list_saved_views(store: Store, dataset_id: int) -> list[SavedView]:
    """The saved views of a dataset, by name, each with the number of groups that match."""
    with store.read() as session:
        rows = list_saved_views_of_dataset(session, dataset_id)
        return [
            _saved_view(row, _count_matching_groups(session, row))
            for row in rows
            if _is_visible(row)
        ]


def save_view(store: Store, dataset_id: int, *, name: str, q: str, actor: str) -> SavedView:
    """Keep a query under a name.

    Raises:
        InputError: There is no name, or the query cannot be understood.
        ConflictError: The name is taken; nobody's view is replaced unseen.
    """
    name = strip_and_check_title(name, "a saved view")
    parse_query(q)
    with store.write() as session:
        rows = list_saved_views_of_dataset(session, dataset_id)
        names = [row.name for row in rows]
        if name in names:
            raise ConflictError(
                f'there is a saved view "{name}" already', hint="Delete it, or choose another name."
            )
        if len(names) >= MAX_VIEWS:
            raise ConflictError(
                f"a dataset has at most {MAX_VIEWS} saved views", hint="Delete one first."
            )
        own = sum(person_of_actor(row.actor) == person_of_actor(actor) for row in rows)
        if own >= MAX_OWN and person_of_actor(actor) != LOCAL_USER:
            raise ConflictError(
                f"one person has at most {MAX_OWN} saved views in a dataset",
                hint="Delete one of your saved views first.",
            )
        identity = insert_saved_view(session, dataset_id, name=name, query=q.strip(), actor=actor)
        saved = _read_visible_view(session, identity)
        session.respond(saved)
    return saved


def read_saved_view(store: Store, view_id: int) -> SavedView:
    """A saved view; raises NotFoundError when there is none."""
    with store.read() as session:
        return _read_visible_view(session, view_id)


def remove_saved_view(store: Store, view_id: int) -> SavedView:
    """Forget a saved view; returns what it was.

    Raises:
        NotFoundError: There is none.
    """
    with store.write() as session:
        view = _read_visible_view(session, view_id)
        delete_saved_view(session, view_id)
        session.respond(view)
    return view


def _read_visible_view(session: Session, view_id: int) -> SavedView:
    row = find_saved_view(session, view_id)
    if row is None or not _is_visible(row):
        raise NotFoundError(f"there is no saved view {view_id}")
    return _saved_view(row, _count_matching_groups(session, row))


def _is_visible(row: SavedViewModel) -> bool:
    """Whether whoever asks may know of a view: its number of groups answers its query."""
    return sees_independent_work(row.dataset_id) or not query_reveals_hidden_work(row.query)


def _count_matching_groups(session: Session, row: SavedViewModel) -> int:
    """How many groups match; none where a query of an older version is no longer understood."""
    try:
        conditions = parse_query(row.query).conditions
    except InputError:
        return 0
    return GroupListing(session, row.dataset_id, conditions).count()


def _saved_view(row: SavedViewModel, groups: int) -> SavedView:
    return SavedView(row.id, row.name, row.query, row.actor, row.created, groups)
