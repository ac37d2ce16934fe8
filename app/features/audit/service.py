"""Audit: what people do that changes no group, written to the log; and who said and did what, read from it, for admins
and for the leads of a dataset.

What was done before there were accounts is shown as a person's, once.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from enum import StrEnum
from typing import Any

from app.db.log import NewLogEntry, append_entries, iterate_single_edits
from app.db.session import Session, now
from app.db.store import Store
from app.errors import ConflictError, NotFoundError
from app.features.audit.queries import AuditQuery as AuditQuery
from app.features.audit.queries import AuditRow, list_audit_rows
from app.features.comments.queries import find_group
from app.features.people.queries import find_person_by_id
from app.features.people.roles import PERSON, require_no_token
from app.features.people.visibility_queries import Visibility, find_alias, insert_alias
from app.json_text import Moment
from app.soccer.actors import LOCAL_USER
from app.wording import plural

AUDIT_EVENT = "deed"
"""Kind of the log's entries about what was made, changed or deleted beside the groups."""
JOB = "job"
"""Kind of the log's entries about jobs that somebody asked for."""


def add_audit_event(
    session: Session, actor: str, did: str, dataset_id: int | None, **what: str | int | None
) -> None:
    """Write into the log who did something, in the transaction in which it happens.

    Args:
        session: A write session.
        actor: Who.
        did: What, in words: ``webhook deleted``.
        dataset_id: Of which dataset; None: of none.
        what: What tells it from others of its kind; nothing secret.
    """
    append_entries(
        session, [NewLogEntry(AUDIT_EVENT, actor, now(), {"did": did, **what}, dataset_id)]
    )


def log_job_request(
    session: Session, actor: str, job: int, kind: str, title: str, dataset_id: int | None
) -> None:
    """Write into the log who asked for a job."""
    body = {"job": job, "kind": kind, "title": title}
    append_entries(session, [NewLogEntry(JOB, actor, now(), body, dataset_id)])


def record_audit_event(
    store: Store, actor: str, did: str, dataset_id: int | None, **what: str | int | None
) -> None:
    """The same where what happens is in no transaction: a file that goes. Answers the request."""
    with store.write() as session:
        add_audit_event(session, actor, did, dataset_id, **what)
        session.respond(None)


def find_owner_of_local_work(store: Store) -> str | None:
    """As whose the work of the single user is shown; None where it was given to nobody."""
    with store.read() as session:
        return find_alias(session, LOCAL_USER)


def assign_local_work(store: Store, person_id: int, *, actor: str) -> str:
    """Show what was done until now without an account as a person's; returns their name.

    Raises:
        NotFoundError: There is nobody of that id.
        ConflictError: It was given to somebody before.
        ForbiddenError: A token asks.
    """
    require_no_token(actor)
    with store.write() as session:
        person = find_person_by_id(session, person_id)
        if person is None:
            raise NotFoundError.person(person_id)
        before = find_alias(session, LOCAL_USER)
        if before is not None:
            raise ConflictError(
                f"the work of the user {LOCAL_USER} is already assigned to {before}",
                hint="It can be assigned only once, to one person.",
            )
        at = now()
        body = {"person": person.name, "did": "adopted", "role": person.role, "from": LOCAL_USER}
        append_entries(session, [NewLogEntry(PERSON, actor, at, body)])
        insert_alias(session, LOCAL_USER, person_id, person.name, at, actor)
        return str(person.name)


MOST_LOOKED_AT = 20_000
"""Entries that one page of a search looks through; the next page goes on from there."""
_BATCH = 500


class AuditTopic(StrEnum):
    """What an entry of the log is about."""

    EDIT = "edit"
    VERDICT = "verdict"
    COMMENT = "comment"
    POLICY = "policy"
    VERSION = "version"
    IMPORT = "import"
    PEOPLE = "people"
    JOB = "job"
    WORK = "work"
    OTHER = "other"


KINDS: Mapping[AuditTopic, tuple[str, ...]] = {
    AuditTopic.EDIT: (
        *("edit", "undo", "redo", "pitch", "position", "noise", "paint"),
        *("station_edit", "station_undo", "station_redo"),
    ),
    AuditTopic.VERDICT: ("verdict", "verdict_batch", "verdict_batch_undo", "dismissal"),
    AuditTopic.COMMENT: ("comment",),
    AuditTopic.POLICY: ("policy",),
    AuditTopic.VERSION: ("freeze",),
    AuditTopic.IMPORT: ("dataset", "dataset_deleted", "import", "station", "camera", "spare"),
    AuditTopic.PEOPLE: ("person",),
    AuditTopic.JOB: ("job",),
    AuditTopic.WORK: ("work", "take", "agreement", "gold", "guideline"),
    AuditTopic.OTHER: ("deed",),
}
"""Kinds of the log's entries by what they are about."""
_FAMILIES = {kind: family for family, kinds in KINDS.items() for kind in kinds}


@dataclass(frozen=True)
class AuditEntry:
    """One thing that somebody said or did.

    Attributes:
        actor: Name of the person, with the name of the token for a script's request.
        kind: Of the entry in the log.
        sentence: What, in words.
        dataset: None: of none, or it is gone.
        network: From which address, where that is known.
        address: Of the page that it is about; None where there is none.
        hash: Of the entry, in the chain of the log.
    """

    id: int
    at: Moment
    actor: str
    family: AuditTopic
    kind: str
    sentence: str
    dataset: str | None
    group_id: int | None
    group: str | None
    network: str | None
    address: str | None
    hash: str


@dataclass(frozen=True)
class AuditPage:
    """Entries, the newest first; ``next`` is where the page after this one begins, None at the end."""

    items: list[AuditEntry]
    next: int | None


def read_audit(
    store: Store,
    query: AuditQuery,
    visibility: Visibility,
    *,
    search: str = "",
    before: int | None = None,
    limit: int = 100,
) -> AuditPage:
    """A page of what was said and done.

    Args:
        store: The database.
        query: Of whom, of what and when.
        visibility: The datasets whose audit somebody may read.
        search: Words that all stand in an entry: its sentence, person, dataset or group.
        before: ``next`` of the page before.
        limit: Entries at most. A search looks through ``MOST_LOOKED_AT`` at a time, and may give fewer.
    """
    words = search.casefold().split()
    batch = _BATCH if words else limit + 1
    found: list[AuditEntry] = []
    looked = 0
    with store.read() as session:
        while looked < MOST_LOOKED_AT:
            rows = list_audit_rows(session, query, visibility, before, batch)
            for row in rows:
                entry = _build_audit_entry(row)
                if _contains_words(entry, words):
                    if len(found) == limit:
                        return AuditPage(found, before)
                    found.append(entry)
                before = row.id
            looked += len(rows)
            if len(rows) < batch:
                return AuditPage(found, None)
    return AuditPage(found, before)


def require_group(store: Store, group_id: int) -> None:
    """Raise NotFoundError where there is no such group."""
    with store.read() as session:
        if find_group(session, group_id) is None:
            raise NotFoundError.group(group_id)


def iterate_audit_entries(
    store: Store, query: AuditQuery, visibility: Visibility, search: str = ""
) -> Iterator[AuditEntry]:
    """All of it, a page at a time, so that a long log fits into memory.

    The first page is read at once: a question that cannot be asked is refused before anything is sent.
    """

    def read_page_after(before: int | None) -> AuditPage:
        return read_audit(store, query, visibility, search=search, before=before, limit=_BATCH)

    def iterate_entries(page: AuditPage) -> Iterator[AuditEntry]:
        yield from page.items
        while page.next is not None:
            page = read_page_after(page.next)
            yield from page.items

    return iterate_entries(read_page_after(None))


def _contains_words(entry: AuditEntry, words: list[str]) -> bool:
    if not words:
        return True
    parts = (entry.actor, entry.kind, entry.sentence, entry.dataset, entry.group, entry.network)
    text = " ".join(part for part in parts if part).casefold()
    return all(word in text for word in words)


def _build_audit_entry(row: AuditRow) -> AuditEntry:
    body = row.body if isinstance(row.body, dict) else {}
    network = body.get("address") if row.kind == "person" else None
    return AuditEntry(
        id=row.id,
        at=row.at,
        actor=row.actor,
        family=_FAMILIES.get(row.kind, AuditTopic.OTHER),
        kind=row.kind,
        sentence=_SENTENCES.get(row.kind, _describe_kind)(row, body),
        dataset=row.dataset,
        group_id=row.group_id if row.label is not None else None,
        group=row.label,
        network=network or None,
        address=_page_address(row, body),
        hash=row.hash,
    )


def _page_address(row: AuditRow, body: Mapping[str, Any]) -> str | None:
    if row.label is not None and row.group_id is not None:
        if row.kind == "comment":
            return f"/review/{row.group_id}?thread={body.get('thread')}"
        return f"/review/{row.group_id}/history?entry={row.id}"
    if row.kind == "person":
        return "/people"
    if row.kind == "job":
        return "/jobs"
    if row.dataset is None:
        return None
    pages = {"policy": "/policy", "freeze": "/versions", "deed": "/statistics"}
    return f"/datasets/{row.dataset}{pages.get(row.kind, '')}"


def _describe_kind(row: AuditRow, _body: Mapping[str, Any]) -> str:
    return row.kind.replace("_", " ")


def _describe_edit(row: AuditRow, body: Mapping[str, Any]) -> str:
    edit = body.get("edit")
    edits = edit if isinstance(edit, dict) else body
    verb = {"undo": "undid: ", "redo": "redid: "}.get(row.kind.removeprefix("station_"), "")
    return verb + "; ".join(_describe_single_edit(row, one) for one in iterate_single_edits(edits))


def _describe_single_edit(row: AuditRow, edit: Mapping[str, Any]) -> str:
    name = str(edit.get("edit", row.kind))
    view = f" of view {edit['view']}" if edit.get("view") else ""
    lines = edit.get("lines")
    names = f": {', '.join(lines)}" if isinstance(lines, dict) and lines else ""
    if name == "include_view":
        what = "use" if edit.get("included") else "leaving out"
    else:
        what = name.removeprefix("set_").replace("_", " ")
    return f"{what}{view}{names}"


def _describe_dismissal(_row: AuditRow, body: Mapping[str, Any]) -> str:
    did = "dismissed the finding" if body.get("dismissed") else "reopened the finding"
    kind = str(body.get("kind")).replace("_", " ")
    place = f" in {body['view']}" if body.get("view") else ""
    why = f": {body['note']}" if body.get("note") else ""
    return f"{did} {kind}{place}{why}"


def _describe_verdict(_row: AuditRow, body: Mapping[str, Any]) -> str:
    parts = [str(body.get("state"))]
    if body.get("reason"):
        parts.append(f"because of {str(body['reason']).replace('_', ' ')}")
    if body.get("override"):
        parts.append(f"although {str(body['override']).replace('_', ' ')} fails")
    return " ".join(parts) + (f": {body['note']}" if body.get("note") else "")


def _describe_bulk_verdict(row: AuditRow, body: Mapping[str, Any]) -> str:
    verb = "undid verdicts on" if row.kind.endswith("undo") else f"{body.get('state', 'changed')}"
    count = body.get("changed", body.get("groups"))
    return f"{verb} {plural(count, 'group') if isinstance(count, int) else 'many groups'} at once"


def _describe_comment(_row: AuditRow, body: Mapping[str, Any]) -> str:
    did = {"said": "commented", "edited": "changed a comment", "deleted": "deleted a comment"}
    did |= {"resolved": "resolved a thread", "reopened": "reopened a thread"}
    verb = did.get(str(body.get("did")), "commented")
    return f"{verb}: {body['text']}" if body.get("text") else verb


_WAYS = {"passkey": " by passkey", "sign_on": " by single sign-on"}


def _describe_person_change(_row: AuditRow, body: Mapping[str, Any]) -> str:
    did = "password chosen" if body.get("did") == "password" else body.get("did")
    token = f" “{body['token']}”" if isinstance(body.get("token"), str) else ""
    way = _WAYS.get(str(body.get("way")), "")
    role = f" ({body['role']})" if body.get("role") and "role" in str(body.get("did")) else ""
    return f"{body.get('person')}: {did}{way}{token}{role}"


def _describe_job(_row: AuditRow, body: Mapping[str, Any]) -> str:
    return f"requested: {body.get('title')}"


def _describe_event(_row: AuditRow, body: Mapping[str, Any]) -> str:
    more = [str(value) for name, value in body.items() if name != "did" and value is not None]
    return f"{body.get('did')}: {', '.join(more)}" if more else str(body.get("did"))


_BATCH_EVENTS = {"made": "assigned", "changed": "changed", "closed": "closed", "deleted": "deleted"}


_STARTS = {
    "imported": "the imported annotations",
    "without_balls": "lines without balls",
    "bare": "pictures only",
}


def _find_work_sentence(row: AuditRow, body: Mapping[str, Any]) -> str | None:
    """What became of batches, of somebody's own annotation, of gold groups and of guidelines; None: none of these."""
    did, person, group = (body.get(name) for name in ("did", "person", "group"))
    why = f": {body['reason']}" if body.get("reason") else ""
    verdict = f", {body['verdict']}" if body.get("verdict") else ""
    sentences = {
        ("take", "adopted"): f"took over {person}’s independent annotation",
        ("take", "handed in"): f"submitted their independent annotation{verdict}",
        ("take", "handed back"): f"returned to {person}{why}",
        ("work", "handed back"): f"returned to {person}{why}",
        ("work", "handed in"): f"submitted group {group} of batch {body.get('batch')}",
        ("work", "taken back"): f"reopened group {group} of batch {body.get('batch')}",
        ("agreement", "agreed"): f"annotations agree, {person}’s is used",
        ("agreement", "decided"): f"chose {person}’s annotation",
        ("agreement", "reopened"): f"undid the decision for {person}’s annotation",
        ("agreement", "limits"): "set the limits of agreement",
        ("gold", "marked"): f"marked group {group} as gold",
        (
            "gold",
            "changed",
        ): f"set what annotators of gold group {group} begin with: {_STARTS.get(str(body.get('start')))}",
        ("gold", "unmarked"): f"unmarked gold group {group}",
    }
    if row.kind == "work" and did in _BATCH_EVENTS and "name" in body:
        return f"{_BATCH_EVENTS[did]} the batch “{body['name']}”"
    if row.kind == "gold" and "groups" in body:
        return f"marked {plural(len(body['groups']), 'group')} of a {body['source']} as gold"
    if row.kind == "guideline" and "number" in body:
        return f"wrote version {body['number']} of the guidelines"
    return sentences.get((row.kind, str(did)))


def _describe_work(row: AuditRow, body: Mapping[str, Any]) -> str:
    sentence = _find_work_sentence(row, body)
    if sentence is not None:
        return sentence
    parts = ("name", "batch", "group", "take", "person")
    about = [f"{part} {body[part]}" for part in parts if isinstance(body.get(part), (int, str))]
    return f"{row.kind} {body.get('did', 'written')}" + (f": {', '.join(about)}" if about else "")


def _make_describer_with_name(verb: str) -> Callable[[AuditRow, Mapping[str, Any]], str]:
    def describe(_row: AuditRow, body: Mapping[str, Any]) -> str:
        return f"{verb} {body['name']}" if isinstance(body.get("name"), str) else verb

    return describe


_SENTENCES: Mapping[str, Callable[[AuditRow, Mapping[str, Any]], str]] = {
    **dict.fromkeys(KINDS[AuditTopic.EDIT], _describe_edit),
    **dict.fromkeys(KINDS[AuditTopic.WORK], _describe_work),
    "verdict": _describe_verdict,
    "dismissal": _describe_dismissal,
    "verdict_batch": _describe_bulk_verdict,
    "verdict_batch_undo": _describe_bulk_verdict,
    "comment": _describe_comment,
    "person": _describe_person_change,
    "job": _describe_job,
    "deed": _describe_event,
    "policy": _make_describer_with_name("set the policy"),
    "freeze": _make_describer_with_name("froze the version"),
    "dataset": _make_describer_with_name("made the dataset"),
    "dataset_deleted": _make_describer_with_name("deleted the dataset"),
    "import": _make_describer_with_name("imported"),
    "station": _make_describer_with_name("imported a static camera"),
    "camera": _make_describer_with_name("imported a camera"),
    "spare": _make_describer_with_name("imported frames without a ball"),
}
