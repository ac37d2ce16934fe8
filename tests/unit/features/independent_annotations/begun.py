"""A take as a batch begins it."""

from __future__ import annotations

from typing import Any

from app.db.store import Store
from app.features.groups.submit import solve_and_store_group
from app.features.independent_annotations import service as take
from app.features.independent_annotations.queries import IndependentAnnotation
from app.features.independent_annotations.service import begin_annotation_in_session, get_annotation


def begin_for_batch(
    store: Store, group_id: int, person: str, **terms: Any
) -> IndependentAnnotation:
    """Let a person begin a group on a batch's terms, and solve their copy."""
    with store.write() as session:
        begun = begin_annotation_in_session(session, group_id, person=person, **terms)
    solve_and_store_group(store, begun.copy_id)
    return begun


def begin_take(store: Store, group_id: int, *, person: str) -> IndependentAnnotation:
    """The take that a person begins of a group."""
    return get_annotation(store, take.begin_annotation(store, group_id, person=person).id)
