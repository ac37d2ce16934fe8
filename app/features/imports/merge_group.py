"""One group of this installation merged with the same group of another, with its verdicts."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from app.db.log import NewLogEntry, append_entries
from app.db.session import Session, now
from app.features.findings.queries import (
    insert_dismissal,
    list_group_import_findings,
    read_dismissals_to_export,
)
from app.features.groups.queries import StoredGroup, read_groups
from app.features.groups.reimport import KeptEditFinding
from app.features.groups.revision_chain import RevisionChain, format_pitch_size
from app.features.groups.revision_queries import save_reimported_group
from app.features.imports.body import collect_view_and_station_ids, make_import_entry_body
from app.features.imports.ingest import ImportContext, IngestReport, save_findings
from app.features.imports.merge_parse import MergeGroup
from app.features.imports.queries import VERDICT, list_verdicts_of_groups
from app.features.pitches.service import set_pitch_of_groups
from app.features.verdicts.queries import (
    StoredVerdict,
    find_next_verdict_id,
    insert_verdicts_and_end_work,
)
from app.soccer.codec import station_digest, view_digest
from app.soccer.finding import Dismissal
from app.soccer.group import Group, View


@dataclass(frozen=True)
class EditStateDigests:
    """One unit that is edited as a whole, as an installation has it.

    Attributes:
        now: Digest of its present state.
        base: Digest of what its dataset brought.
        past: Digests of the states that it went through, oldest first, the present one last.
    """

    now: str
    base: str
    past: Sequence[str]

    def contains_history_of(self, other: EditStateDigests) -> bool:
        """Whether it went through everything that the other did, in that order."""
        states = iter(self.past)
        return all(state in states for state in other.past)


FOLLOW, STAY, CONFLICT, UPSTREAM = "follow", "stay", "conflict", "upstream"


def choose_merge_action(here: EditStateDigests, there: EditStateDigests) -> str:
    """What becomes of a unit (a view or a camera) in this installation.

    Returns:
        ``follow``: take the other's; ``stay``: nothing to do; ``conflict``: both edited it and
        neither is behind the other; ``upstream``: take the other's edit, which was made on
        another state of the dataset than the one here.
    """
    if here.now == there.now:
        return STAY
    if there.contains_history_of(here):
        return FOLLOW
    if here.contains_history_of(there) or there.now == there.base:
        return STAY
    if here.now == here.base:
        return FOLLOW if here.now in there.past else UPSTREAM
    behind, ahead = here.now in there.past, there.now in here.past
    if behind == ahead:
        return CONFLICT
    return FOLLOW if behind else STAY


def merge_group(
    session: Session,
    origin: ImportContext,
    stored: StoredGroup,
    chain: RevisionChain,
    exported: MergeGroup,
    report: IngestReport,
) -> bool:
    """Bring a group up to what another installation made of it; whether anything changed."""
    merged, kept = _merge_views(stored, chain, exported)
    pitch = choose_merge_action(*_make_pitch_histories(stored, chain, exported))
    kept += _make_kept_edit_findings(None, pitch, f"pitch of {merged.key}")
    fresh = _filter_new_findings(session, stored.id, kept)
    if merged == stored.group and pitch not in (FOLLOW, UPSTREAM) and not fresh:
        return False
    at = now()
    save_reimported_group(session, stored, merged, at=at, source=chain.base)
    after = read_groups(session, [stored.id])[stored.id]
    noticed = save_findings(session, after, kept)
    base = chain.base
    body = make_import_entry_body(
        merged, base, origin.source, stored.source_hash, collect_view_and_station_ids(after)
    )
    body["kept"] = [[item.view, item.sentence] for item in noticed]
    body["carried"] = list(exported.log)
    append_entries(
        session, [NewLogEntry("import", origin.actor, at, body, origin.dataset_id, stored.id)]
    )
    if pitch in (FOLLOW, UPSTREAM):
        # An edit of its own: the size before can be had back here, too.
        set_pitch_of_groups(
            session, origin.dataset_id, [stored.id], exported.group.pitch, origin.actor
        )
    report.findings += len(fresh)
    return True


def _merge_views(
    stored: StoredGroup, chain: RevisionChain, exported: MergeGroup
) -> tuple[Group, list[KeptEditFinding]]:
    group, kept = stored.group, list[KeptEditFinding]()
    for view in stored.group.views:
        other, base = exported.group.view(view.key), exported.base.view(view.key)
        if other is None or base is None or other.station.shared != view.station.shared:
            continue
        ball = choose_merge_action(
            _make_local_view_history(stored, chain, view),
            _make_exported_view_history(exported, other, base),
        )
        if ball in (FOLLOW, UPSTREAM):
            view = replace(
                view, balls=other.balls, included=other.included, left_out=other.left_out
            )
        kept += _make_kept_edit_findings(view.key, ball, f"ball of {view.key}")
        if not view.station.shared:
            here, there = (
                _make_local_station_history(stored, chain, view),
                _make_exported_station_history(exported, other, base),
            )
            lines = choose_merge_action(here, there)
            if lines in (FOLLOW, UPSTREAM):
                view = replace(view, station=view.station.with_annotations_of(other.station))
            kept += _make_kept_edit_findings(view.key, lines, f"lines or the camera of {view.key}")
        group = group.with_view(view)
    return group, kept


def _make_kept_edit_findings(view: str | None, decision: str, what: str) -> list[KeptEditFinding]:
    if decision == CONFLICT:
        sentence = (
            f"another installation edited the {what} too; the edit of this installation is kept"
        )
    elif decision == UPSTREAM:
        sentence = (
            f"another installation edited the {what} on another state of the "
            "dataset; its edit is in place now"
        )
    else:
        return []
    return [KeptEditFinding(view, sentence)]


def _make_pitch_histories(
    stored: StoredGroup, chain: RevisionChain, exported: MergeGroup
) -> tuple[EditStateDigests, EditStateDigests]:
    here = EditStateDigests(
        format_pitch_size(stored.group.pitch), format_pitch_size(chain.base.pitch), chain.pitches
    )
    size, base = format_pitch_size(exported.group.pitch), format_pitch_size(exported.base.pitch)
    return here, EditStateDigests(size, base, exported.pitches)


def _make_local_view_history(
    stored: StoredGroup, chain: RevisionChain, view: View
) -> EditStateDigests:
    present, base = stored.view_digests[view.key]
    return EditStateDigests(present, base, chain.views.get(view.key, (present,)))


def _make_exported_view_history(exported: MergeGroup, view: View, base: View) -> EditStateDigests:
    past = exported.views.get(view.key, ())
    return EditStateDigests(view_digest(view), view_digest(base), past)


def _make_local_station_history(
    stored: StoredGroup, chain: RevisionChain, view: View
) -> EditStateDigests:
    own = stored.stations[view.key]
    return EditStateDigests(
        own.digest, own.source_digest, chain.stations.get(view.key, (own.digest,))
    )


def _make_exported_station_history(
    exported: MergeGroup, view: View, base: View
) -> EditStateDigests:
    past = exported.stations.get(view.key, ())
    return EditStateDigests(station_digest(view.station), station_digest(base.station), past)


def _filter_new_findings(
    session: Session, group_id: int, kept: list[KeptEditFinding]
) -> list[KeptEditFinding]:
    """The findings that the group does not have yet."""
    if not kept:
        return []
    known = set(list_group_import_findings(session, group_id))
    return [item for item in kept if (item.view, item.sentence) not in known]


def merge_verdicts(
    session: Session, origin: ImportContext, group_id: int, exported: Sequence[Mapping[str, Any]]
) -> bool:
    """Add the verdicts of another installation that are not here; whether there were any.

    The last one added is the one that counts, so one that was given here later than all of
    theirs is given once more, with its own time and person.
    """
    if not exported:
        return False
    known = list_verdicts_of_groups(session, [group_id]).get(group_id, [])
    seen = {_verdict_identity(item) for item in known}
    fresh = [item for item in exported if _verdict_identity(item) not in seen]
    if not fresh:
        return False
    fresh = sorted(fresh, key=lambda item: str(item["at"]))
    if known and str(known[-1]["at"]) > str(fresh[-1]["at"]):
        fresh.append(known[-1])
    first = find_next_verdict_id(session)
    given = [StoredVerdict(first + place, group_id, **item) for place, item in enumerate(fresh)]
    insert_verdicts_and_end_work(session, origin.dataset_id, given, actor=origin.actor, at=now())
    return True


def merge_dismissals(
    session: Session, origin: ImportContext, group_id: int, exported: Sequence[Mapping[str, Any]]
) -> bool:
    """Add what was dismissed in another installation and is not here; whether there was any.

    The last one of a finding counts: what was said here later than the first of theirs is said
    once more, after them.
    """
    if not exported:
        return False
    known = read_dismissals_to_export(session, [group_id]).get(group_id, [])
    fresh = [item for item in exported if item not in known]
    if not fresh:
        return False
    first = min(str(item["at"]) for item in fresh)
    later = [item for item in known if str(item["at"]) > first]
    brought = (origin.actor, now())
    for item in sorted([*fresh, *later], key=lambda one: str(one["at"])):
        values = {name: value for name, value in item.items() if name != "dismissed"}
        insert_dismissal(
            session,
            origin.dataset_id,
            group_id,
            Dismissal(**values),
            dismissed=item["dismissed"],
            brought=brought,
        )
    return True


def _verdict_identity(verdict: Mapping[str, Any]) -> tuple[Any, ...]:
    return tuple(verdict[name] for name in VERDICT)
