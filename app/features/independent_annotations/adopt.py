"""What becomes of a submitted annotation: it is adopted for its group, or returned to its person."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

from app.db.log import (
    NewLogEntry,
    append_entries,
    iterate_group_entries_of_kinds,
    list_group_entry_kinds,
    list_station_entry_kinds,
)
from app.db.session import Session, now
from app.db.store import Store
from app.errors import ConflictError, InputError
from app.features.batches.queries import find_batch
from app.features.groups.edit import (
    CompositeEdit,
    Edit,
    SetBalls,
    SetCalibrationSource,
    SetLines,
    SetPictureGeometry,
    SetStationCalibrationSource,
    SetStationLines,
    SetViewInclusion,
    StationEdit,
)
from app.features.groups.edit_codec import edit_and_inverse_to_json
from app.features.groups.history import read_group_before_entry, read_station_before_entry
from app.features.groups.queries import StoredGroup
from app.features.groups.revision_queries import refresh_inputs_hashes
from app.features.groups.state import GroupState, require_group, require_unchanged
from app.features.groups.submit import read_and_solve_group, read_group_etag, submit_edit
from app.features.groups.view_paint import PaintUpdater
from app.features.groups.view_queries import StoredStation, list_groups_of_station, save_station
from app.features.independent_annotations.copying import (
    rebuild_group_before_edits,
    rename_views_as_original,
)
from app.features.independent_annotations.merge import merge_group, merge_station
from app.features.independent_annotations.queries import (
    GOLD,
    INDEPENDENT,
    IndependentAnnotation,
    find_annotation_of_copy,
    list_annotations_of_batch,
    list_annotations_of_group,
    update_annotation,
)
from app.features.independent_annotations.service import (
    DisclosedAnnotation,
    disclose_annotation_in_session,
    get_annotation,
    read_annotation,
)
from app.features.independent_annotations.submission_queries import KIND, RETURNED, reopen_copy
from app.features.notifications.queries import NotificationKind
from app.features.notifications.service import notify_person
from app.features.queue.refresh_queries import refresh_queue
from app.features.verdicts.queries import (
    StoredVerdict,
    find_next_verdict_id,
    insert_verdicts_and_end_work,
    read_last_verdicts,
)
from app.features.webhooks.queries import HANDED_BACK, make_time_suffix, queue_webhook_messages
from app.soccer.actors import person_of_actor
from app.soccer.group import Group, Station

ADOPTED = "adopted"
"""What the entry of an annotation that was taken over says was done."""
MAX_REASON = 500
"""Letters of the sentence that says why."""


def adopt_annotation(
    store: Store,
    annotation_id: int,
    *,
    actor: str,
    paint: PaintUpdater | None = None,
    also: Callable[[Session], None] | None = None,
    decided: bool = True,
) -> GroupState:
    """Take a person's annotation and verdict over into the original, in one transaction.

    What the person left as it was stays as the original has it by now. The edit and the verdict are
    that person's; that ``actor`` decided so is an entry of its own. Undo takes the edit back as any
    other. Lines of a static camera are edits of that camera.

    Args:
        store: The database.
        annotation_id: The annotation.
        actor: Who decided so.
        paint: Reads the paint of edited lines again.
        also: Writes what becomes true with it into the same transaction.
        decided: Somebody decided for it: it counts also where the original was changed meanwhile.

    Raises:
        NotFoundError: There is no such annotation.
        ConflictError: It is not submitted, was decided about, or is of a gold group; or nobody
            decided, and the original was changed in the same places since it began.
        StaleRevisionError: Somebody changed the original at the same moment.
    """
    annotation = get_annotation(store, annotation_id)
    _require_adoptable(annotation)
    # First: what changes the original from here on is seen by the edit that builds on it.
    etag = read_group_etag(store, annotation.group_id)
    with store.read() as session:
        copy = require_group(session, annotation.copy_id)
        original = require_group(session, annotation.group_id)
        start = _read_group_at_start(session, annotation, original, copy)
    copy = replace(copy, group=rename_views_as_original(original.group, copy.group))
    merged = merge_group(start, original.group, copy.group)
    if not decided:
        _require_only_own_changes(annotation, merged.both)
    edit = CompositeEdit(tuple(make_edits_between(original.group, merged.group)))
    after: list[GroupState] = []

    def record_adoption(session: Session) -> None:
        current = read_annotation(session, annotation_id)
        _require_adoptable(current)
        if current.submitted != annotation.submitted:
            raise ConflictError(
                f"{annotation.person} submitted this annotation anew meanwhile",
                hint="Look at it again, then apply it.",
            )
        _adopt_stations(session, annotation, decided=decided)
        copy_verdict_to_original(session, annotation, actor=annotation.person)
        at = now()
        update_annotation(session, annotation_id, settled=at)
        body = {"take": annotation_id, "person": annotation.person, "did": ADOPTED}
        append_entries(
            session, [NewLogEntry(KIND, actor, at, body, original.dataset_id, original.id)]
        )
        if also is not None:
            also(session)
        refresh_queue(session, [original.id])
        after.append(read_and_solve_group(session, original.id))
        session.respond(after[-1])

    if edit.edits:
        submit_edit(
            store,
            annotation.group_id,
            edit,
            if_match=etag,
            actor=annotation.person,
            then=lambda session, _state: record_adoption(session),
            paint=paint,
        )
    if not after:
        # The original says the same already.
        with store.write() as session:
            require_unchanged(session, original.id, etag, original.group.key)
            record_adoption(session)
    return after[-1]


def _read_group_at_start(
    session: Session, annotation: IndependentAnnotation, original: StoredGroup, copy: StoredGroup
) -> Group:
    """The original as it was for whoever began the copy, under its own names."""
    ((_, begun, _),) = list_group_entry_kinds(session, [copy.id], ["import"])
    start = read_group_before_entry(session, original, begun)
    batch = None if annotation.batch_id is None else find_batch(session, annotation.batch_id)
    nameless = copy.group.key != original.group.key
    if batch is None or not (batch.blind or nameless):
        return start
    if any(
        (one.batch_id, one.kind) == (annotation.batch_id, INDEPENDENT)
        and one.settled is not None
        and one.settled <= annotation.begun
        for one in list_annotations_of_group(session, original.id)
    ):
        # The group waited again after another one: this annotation takes the place of that one.
        return start
    then = replace(original, group=start)
    return rebuild_group_before_edits(session, then, batch.created, before=begun)


def _require_only_own_changes(annotation: IndependentAnnotation, both: Sequence[str]) -> None:
    """Raise ConflictError where the original was changed in the same places meanwhile."""
    if both:
        raise ConflictError(
            f"{annotation.person} and others changed {both[0]} of the same group",
            hint="Compare the annotation with the group, then apply or return it.",
        )


def make_edits_between(before: Group, after: Group) -> Iterator[Edit]:
    """The edits that make what one annotation of a group says of another one.

    Views are those of the first, by their keys; static cameras are left alone.
    """
    for view in before.views:
        own = after.view(view.key)
        if own is None:
            continue
        if own.balls != view.balls:
            yield SetBalls(view.key, own.balls)
        if (own.included, own.left_out) != (view.included, view.left_out):
            why = own.left_out
            reason = (None, None) if why is None else (why.reason, why.note)
            yield SetViewInclusion(view.key, own.included, *reason)
        if view.station.shared:
            continue
        lines = _make_line_edit(view.station, own.station)
        if lines is not None:
            yield SetLines(view.key, lines.lines, lines.proposed, lines.not_visible)
        if own.station.calibration != view.station.calibration:
            yield SetCalibrationSource(view.key, own.station.calibration)
        if own.station.picture != view.station.picture:
            yield SetPictureGeometry(view.key, own.station.picture)


def _make_line_edit(before: Station, after: Station) -> SetStationLines | None:
    names = sorted({*before.lines, *after.lines})
    changed = {
        name: tuple(after.lines[name]) if name in after.lines else None
        for name in names
        if before.lines.get(name) != after.lines.get(name)
    }
    for name in ({*before.proposed} ^ {*after.proposed}) | (
        {*before.not_visible} ^ {*after.not_visible}
    ):
        changed.setdefault(name, tuple(after.lines.get(name, ())) or None)
    if not changed:
        return None
    proposed, not_visible = (
        tuple(one for one in names if one in changed)
        for names in (after.proposed, after.not_visible)
    )
    return SetStationLines(changed, proposed, not_visible)


def _require_adoptable(annotation: IndependentAnnotation) -> None:
    if annotation.kind == GOLD:
        raise ConflictError("this is an annotation of a gold group, whose true values are known")
    if annotation.submitted is None:
        raise ConflictError(f"{annotation.person} has not submitted this yet")
    if annotation.settled is not None:
        raise ConflictError("this annotation was adjudicated already")


def _adopt_stations(session: Session, annotation: IndependentAnnotation, *, decided: bool) -> None:
    """Edit the static cameras as the person edited those of their copies."""
    original, copy = (
        require_group(session, number) for number in (annotation.group_id, annotation.copy_id)
    )
    own = {held.station.key: held for held in copy.stations.values()}
    for held in {held.id: held for held in original.stations.values()}.values():
        copied = own.get(held.station.key)
        if not held.station.shared or copied is None or copied.station == held.station:
            continue
        start, reference = _read_stations_at_start(session, annotation, held, copied)
        merged = merge_station(start, held.station, copied.station, reference=reference)
        if not decided:
            _require_only_own_changes(
                annotation, [f"{what} of {held.station.key}" for what in merged.both]
            )
        _edit_station(session, held, merged.station, annotation.person)


def _read_stations_at_start(
    session: Session,
    annotation: IndependentAnnotation,
    original: StoredStation,
    copied: StoredStation,
) -> tuple[Station, Station]:
    """What a person's static camera was when theirs was last brought into the original, and what
    that was then; before the first time, what the original was when their copies began.
    """
    adopted = _find_last_adoption(session, annotation, original)
    if adopted is not None:
        return (
            read_station_before_entry(session, copied, adopted),
            read_station_before_entry(session, original, adopted),
        )
    entries = list_station_entry_kinds(session, copied.id, ["station"])
    if not entries:
        return original.station, original.station
    start = read_station_before_entry(session, original, entries[0].id)
    return start, start


def _find_last_adoption(
    session: Session, annotation: IndependentAnnotation, original: StoredStation
) -> int | None:
    """The entry of the last adoption that brought a person's copy of a static camera in."""
    groups = set(list_groups_of_station(session, original.id))
    adopted = {
        one.id: one.group_id
        for one in list_annotations_of_batch(session, annotation.batch_id, original.dataset_id)
        if one.person == annotation.person and one.settled is not None and one.group_id in groups
    }
    entries = iterate_group_entries_of_kinds(session, sorted(set(adopted.values())), [KIND])
    found = [
        entry.id
        for entry in entries
        if entry.body["did"] == ADOPTED and entry.body["take"] in adopted
    ]
    return max(found, default=None)


def _edit_station(session: Session, held: StoredStation, wanted: Station, person: str) -> None:
    """Make a static camera what it is to be, as edits of a person."""
    station, edits = held.station, list[StationEdit]()
    lines = _make_line_edit(station, wanted)
    edits += [] if lines is None else [lines]
    if wanted.calibration != station.calibration:
        edits.append(SetStationCalibrationSource(wanted.calibration))
    for edit in edits:
        body = edit_and_inverse_to_json(edit, edit.inverse(station))
        station = edit.apply(station)
        entry = NewLogEntry(
            "station_edit", person, now(), body, dataset_id=held.dataset_id, station_id=held.id
        )
        append_entries(session, [entry])
        save_station(session, held, station)
        held = replace(held, station=station, revision=held.revision + 1)
    if edits:
        groups = list_groups_of_station(session, held.id)
        refresh_inputs_hashes(session, groups)
        refresh_queue(session, groups)


def copy_verdict_to_original(
    session: Session, annotation: IndependentAnnotation, *, actor: str, note: str | None = None
) -> StoredVerdict | None:
    """Give the original the verdict of an independent annotation's copy, where there is one.

    Args:
        session: The write session that takes the annotation over; what waits for the verdict is told
            once the queue is refreshed.
        annotation: The independent annotation.
        actor: Whose verdict it is.
        note: Its note, where that of the copy has none.
    """
    given = next(
        iter(read_last_verdicts(session, [annotation.copy_id]).get(annotation.copy_id, ())), None
    )
    if annotation.verdict is None or given is None:
        return None
    after = require_group(session, annotation.group_id)
    verdict = StoredVerdict(
        **{
            **vars(given),
            "id": find_next_verdict_id(session),
            "group_id": after.id,
            "actor": actor,
            "at": now(),
            "note": given.note or note,
            "inputs_hash": after.inputs_hash,
            "policy_hash": after.policy.hash,
        }
    )
    insert_verdicts_and_end_work(session, after.dataset_id, [verdict], actor=actor, at=verdict.at)
    return verdict


def return_annotation(
    store: Store, annotation_id: int, reason: str = "", *, actor: str
) -> DisclosedAnnotation:
    """Let the person of an annotation that was submitted go on with it, and tell them why.

    A comparison of it that waits for a decision waits no longer: it is made anew once it is handed
    in again.

    Raises:
        NotFoundError: There is no such annotation.
        ConflictError: It is not submitted, or it was decided about.
        InputError: There is no sentence, or it is too long.
    """
    checked = strip_and_check_reason(reason)
    if not checked:
        raise InputError(
            "a reason is required to return an annotation",
            hint="Say in a sentence what its annotator should change.",
            pointer="/reason",
        )
    with store.write() as session:
        annotation = read_annotation(session, annotation_id)
        reopen_copy(session, annotation)
        copy = annotation.copy_id
        log_and_notify_return(
            session, KIND, copy, annotation.person, checked, actor=actor, batch=annotation.batch_id
        )
        back = disclose_annotation_in_session(session, read_annotation(session, annotation_id))
        session.respond(back)
        return back


def log_and_notify_return(
    session: Session,
    kind: str,
    group_id: int,
    person: str,
    reason: str,
    *,
    actor: str,
    batch: int | None,
) -> None:
    """Write into the log that a group was returned to somebody, and tell them.

    The entry names the group: its history says so, and a page that has it open hears of it.

    Args:
        session: The write session in which it happens.
        kind: Of the entry.
        group_id: What they worked on; for an annotation of their own, its copy.
        person: Whom it goes back to.
        reason: Why; may be empty.
        actor: Who returns it.
        batch: Of which batch it is; None: of none.
    """
    group = require_group(session, group_id)
    body: dict[str, str | int] = {"did": RETURNED, "person": person, "reason": reason}
    if batch is not None:
        body["batch"] = batch
    at = now()
    append_entries(session, [NewLogEntry(kind, actor, at, body, group.dataset_id, group_id)])
    _announce_return(session, group, person, actor=actor, at=at, batch=batch)
    why = f": {reason}" if reason else ""
    walk = "" if batch is None else f"?q=batch%3A{batch}"
    notify_person(
        session, person, NotificationKind.RETURNED, f"{person_of_actor(actor)} returned {group.group.label or group.group.key} to you{why}",
        actor=actor, address=f"/review/{group_id}{walk}", dataset_id=group.dataset_id, group_id=group_id,
    )  # fmt: skip


def _announce_return(
    session: Session, group: StoredGroup, person: str, *, actor: str, at: str, batch: int | None
) -> None:
    """Tell webhooks of the dataset, for a copy of the one that it is of."""
    row = find_annotation_of_copy(session, group.id)
    where, details = group.dataset_id, {"group": group.id, "person": person}
    if row is not None:
        where = require_group(session, row.group_id).dataset_id
        details = {"group": row.group_id, "person": person, "copy": group.id}
    event = f"group{group.id}_handed_back{make_time_suffix(at)}"
    queue_webhook_messages(
        session, where, HANDED_BACK, event, actor=actor, at=at, batch_id=batch, also=details
    )


def strip_and_check_reason(reason: str) -> str:
    """The sentence without blanks around it; raises InputError where it is too long."""
    text = " ".join(reason.split())
    if len(text) > MAX_REASON:
        raise InputError(f"the reason has at most {MAX_REASON} letters", pointer="/reason")
    return text
