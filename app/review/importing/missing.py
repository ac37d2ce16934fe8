"""Missing: groups that their source brought before and does not bring any more.

They stay, for nobody but a person takes a group out; a finding says what happened, until the
source brings the group again.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence

from app.review.editing.lineage import Lineages
from app.review.editing.upstream import KIND
from app.review.importing.body import import_body, places_of
from app.soccer.group import Group
from app.store.clock import now
from app.store.findings import add_group_findings, group_findings, groups_told
from app.store.group_revisions import save_group
from app.store.groups import StoredGroup, read_groups
from app.store.imports import known_groups
from app.store.log import Entry, append
from app.store.queue import refresh_queue
from app.store.session import Session
from app.store.stored_json import Json

GONE = "this group is gone from the dataset; it stays until a person rejects it"


def of_read_matches(
    session: Session, dataset_id: int, seen: Collection[str], missing: Collection[int]
) -> list[int]:
    """Those of the missing groups whose match came all the same: they are truly gone.

    A source may bring a part of what it brought last, a match at a time.

    Args:
        session: Any session.
        dataset_id: The dataset.
        seen: Keys of the groups that came.
        missing: Ids of groups that the same source brought last and that did not come.
    """
    if not missing:
        return []
    groups = known_groups(session, dataset_id)
    matches = {group.match for group in groups if group.key in seen}
    return [group.id for group in groups if group.id in missing and group.match in matches]


def note_gone(
    session: Session, dataset_id: int, ids: Sequence[int], *, source: str, actor: str
) -> int:
    """Save a finding for each group that has none of the kind yet; returns how many."""
    fresh = sorted(set(ids) - groups_told(session, ids, GONE))
    stored = read_groups(session, fresh)
    lineages = Lineages(session, dataset_id).of(stored.values())
    at, entries = now(), []
    for number, item in stored.items():
        base = lineages[number].base
        save_group(session, item, item.group, at=at, source=base)
        body = _body(item, base, source, group_findings(session, number))
        entries.append(Entry("import", actor, at, body, dataset_id, number))
    if entries:
        append(session, entries)
        add_group_findings(session, KIND, ((number, None, GONE) for number in stored))
        refresh_queue(session, list(stored))
    return len(entries)


def _body(
    stored: StoredGroup,
    base: Group,
    source: str,
    noticed: Iterable[tuple[str | None, str]],
) -> dict[str, Json]:
    body = import_body(stored.group, base, source, stored.source_hash, places_of(stored))
    body["kept"] = [[view, sentence] for view, sentence in [*noticed, (None, GONE)]]
    return body
