"""Query: the text in the queue's box, parsed into fixed fields and operators.

    status:unreviewed jac<0.95 sigma>0.5 finding:low_parallax match:"league/2015" sort:value-desc

``margin`` and ``value`` are shares of a gate's threshold: ``margin<0.1`` finds groups that fail,
or pass by less than a tenth; ``sort:value`` lists first the groups that are closest to a gate's
threshold, on either side.

Terms must all hold; ``field:a,b`` means either; ``-field:a`` means not; a bare word is looked
for in key and label; ``id:12,15`` names groups. There are no patterns: text is compared, never
interpreted.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any

from sqlalchemy import ColumnElement, and_, case, func, not_, or_, select
from sqlalchemy.orm import InstrumentedAttribute

from app.errors import InputError
from app.finite import json_text
from app.soccer.solution import FINDING_KINDS, GATES
from app.store.models import QueueModel

MAX_LENGTH = 1000
MAX_LISTED_LENGTH = 100_000
"""Of a query that comes in a body and lists groups one by one: about 15,000 ids."""
MAX_TERMS = 30
MAX_ID = 2**63 - 1

NUMBERS: dict[str, InstrumentedAttribute[Any]] = {
    "jac": QueueModel.min_jac,
    "jac05": QueueModel.min_jac,
    "error": QueueModel.error_px,
    "error_percent": QueueModel.error_percent,
    "sigma": QueueModel.sigma_m,
    "parallax": QueueModel.parallax_degrees,
    "ratio": QueueModel.size_ratio,
    "size_ratio": QueueModel.size_ratio,
    "height": QueueModel.height_m,
    "distance": QueueModel.distance_m,
    "box": QueueModel.box_px,
    "x": QueueModel.x_m,
    "y": QueueModel.y_m,
    "margin": QueueModel.margin,
    "value": QueueModel.value,
    "views": QueueModel.views,
    "number": QueueModel.number,
}
"""Fields that compare with < <= > >= = and with :, which is =; ``none`` is where there is no
number."""

STATUSES = ("unreviewed", "accepted", "rejected", "deferred")
FLAGS: dict[str, InstrumentedAttribute[Any]] = {
    "stale": QueueModel.stale,
    "solved": QueueModel.solved,
    "passes": QueueModel.passes,
    "fixed": QueueModel.fixed,
}
"""Fields that are ``yes`` or ``no``."""
EXACT: dict[str, InstrumentedAttribute[Any]] = {
    "split": QueueModel.split,
    "key": QueueModel.key,
    "reviewer": QueueModel.reviewer,
    "reason": QueueModel.reason,
    "override": QueueModel.override,
}
"""Fields whose whole text must be the same; ``none`` is where there is none, ``any`` where there
is one."""

SORTS: dict[str, ColumnElement[Any]] = {
    "number": QueueModel.number.expression,
    "value": QueueModel.value.expression,
    "sigma": QueueModel.sigma_m.expression,
    "jac": QueueModel.min_jac.expression,
    "error": QueueModel.error_px.expression,
    "error_percent": QueueModel.error_percent.expression,
    "parallax": QueueModel.parallax_degrees.expression,
    "margin": QueueModel.margin.expression,
    "ratio": QueueModel.size_ratio.expression,
    "height": QueueModel.height_m.expression,
    "distance": QueueModel.distance_m.expression,
    "box": QueueModel.box_px.expression,
    "x": QueueModel.x_m.expression,
    "y": QueueModel.y_m.expression,
    "views": QueueModel.views.expression,
    "findings": func.length(QueueModel.findings)
    - func.length(func.replace(QueueModel.findings, ",", "")),
    "gate": case(
        {name: place for place, name in enumerate(GATES)}, value=QueueModel.gate, else_=None
    ),
    "status": QueueModel.status.expression,
    "split": QueueModel.split.expression,
    "reviewer": QueueModel.reviewer.expression,
    "label": QueueModel.label.expression,
    "newest": QueueModel.changed.expression,
}
"""What the queue can be sorted by; ``findings`` by how many kinds there are, ``gate`` by the
order in which gates are judged."""
TEXT_SORTS = frozenset({"status", "split", "reviewer", "label", "newest"})
"""Sorts whose keys are texts."""

_TERM = re.compile(
    r"""\s*(?P<minus>-)?
        (?:(?P<field>[a-z_0-9]+)(?P<op><=|>=|<|>|=|:))?
        (?:"(?P<quoted>[^"]*)"|(?P<plain>[^\s"]+))(?=\s|$)""",
    re.VERBOSE,
)


@dataclass(frozen=True)
class Query:
    """A parsed query: conditions on ``QueueModel``, and a sort."""

    conditions: tuple[ColumnElement[bool], ...] = field(default=())
    sort: str = "number"
    descending: bool = False


@dataclass(frozen=True)
class _Term:
    field: str
    op: str
    value: str
    pointer: str


def parse_query(text: str, longest: int = MAX_LENGTH) -> Query:
    """Parse a query.

    Args:
        text: The query.
        longest: Most characters. Beyond ``MAX_LENGTH`` there may only be lists of ids.

    Raises:
        InputError: With a pointer ``/q/<position>`` to the term that cannot be understood.
    """
    conditions: list[ColumnElement[bool]] = []
    sort, descending = "number", False
    for negative, term in _terms(text, longest):
        if term.field == "sort":
            sort, descending = _sort(term)
        else:
            condition = _condition(term)
            conditions.append(not_(condition) if negative else condition)
    return Query(tuple(conditions), sort, descending)


def _terms(text: str, longest: int) -> Iterator[tuple[bool, _Term]]:
    if len(text) > longest:
        raise InputError(f"a query has at most {longest} characters", pointer="/q")
    place, count = 0, 0
    while text[place:].strip():
        pointer = f"/q/{place + len(text[place:]) - len(text[place:].lstrip())}"
        found = _TERM.match(text, place)
        count += 1
        if found is None or count > MAX_TERMS:
            problem = "the query has too many terms" if found else "a quote is not closed"
            raise InputError(problem, pointer=pointer)
        value = found["plain"] if found["quoted"] is None else found["quoted"]
        if len(value) > MAX_LENGTH and found["field"] != "id":
            problem = f"only a list of ids may be longer than {MAX_LENGTH} characters"
            raise InputError(problem, pointer=pointer)
        yield bool(found["minus"]), _Term(found["field"] or "", found["op"] or ":", value, pointer)
        place = found.end()


def _sort(term: _Term) -> tuple[str, bool]:
    name = term.value.removesuffix("-desc")
    if name not in SORTS:
        raise InputError(
            f'the queue cannot be sorted by "{term.value}"',
            hint=f"Sorts: {', '.join(SORTS)}, each also with -desc.",
            pointer=term.pointer,
        )
    return name, term.value.endswith("-desc")


def _condition(term: _Term) -> ColumnElement[bool]:
    if term.field in NUMBERS:
        return _number(term)
    if term.op not in (":", "="):
        raise InputError(
            f'"{term.field}" has no order: it compares with : alone', pointer=term.pointer
        )
    if term.field == "id":
        return _listed_groups(term)
    if term.field in FLAGS:
        return FLAGS[term.field].is_(_choice(term, term.value, ("yes", "no")) == "yes")
    test = _TESTS.get(term.field)
    if test is None:
        fields = sorted({*NUMBERS, *FLAGS, *_TESTS, "id", "sort"} - {""})
        raise InputError(
            f'the queue has no field "{term.field}"',
            hint=f"Fields: {', '.join(fields)}.",
            pointer=term.pointer,
        )
    # A bare word may hold commas; a field's value is a list of choices.
    values = [term.value] if term.field == "" else term.value.split(",")
    return or_(*(test(term, value) for value in values))


def _listed_groups(term: _Term) -> ColumnElement[bool]:
    ids = [_id(term, text) for text in term.value.split(",")]
    # One parameter, however many there are: a statement takes a limited number of them.
    listed = func.json_each(json_text(ids)).table_valued("value")
    return QueueModel.group_id.in_(select(listed.c.value))


def _id(term: _Term, text: str) -> int:
    digits = text.isascii() and text.isdigit() and len(text) <= len(str(MAX_ID))
    if not digits or not 1 <= int(text) <= MAX_ID:
        raise InputError(
            f'"{text[:40]}" is not the id of a group',
            hint="For example id:12,15,19; the id of a group stands in its address.",
            pointer=term.pointer,
        )
    return int(text)


def _number(term: _Term) -> ColumnElement[bool]:
    column = NUMBERS[term.field]
    if term.value == "none":
        return column.is_(None)
    try:
        value = float(term.value)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise InputError(
            f'"{term.value}" is not a number',
            hint=f"For example {term.field}<1.5, or {term.field}:none.",
            pointer=term.pointer,
        )
    compared: dict[str, ColumnElement[bool]] = {
        "<": column < value,
        "<=": column <= value,
        ">": column > value,
        ">=": column >= value,
        "=": column == value,
        ":": column == value,
    }
    return compared[term.op]


def _choice(term: _Term, value: str, choices: tuple[str, ...]) -> str:
    if value not in choices:
        raise InputError(
            f'{term.field} cannot be "{value}"',
            hint=f"It is one of {', '.join(choices)}.",
            pointer=term.pointer,
        )
    return value


def _listed(column: InstrumentedAttribute[str], value: str) -> ColumnElement[bool]:
    return column.contains(f",{value},", autoescape=True)


def _status(term: _Term, value: str) -> ColumnElement[bool]:
    return QueueModel.status == _choice(term, value, STATUSES)


def _finding(term: _Term, value: str) -> ColumnElement[bool]:
    if value in ("any", "none"):
        return QueueModel.findings != "" if value == "any" else QueueModel.findings == ""
    return _listed(QueueModel.findings, _choice(term, value, FINDING_KINDS))


def _gate(term: _Term, value: str) -> ColumnElement[bool]:
    """The first failing gate; ``none`` for groups that pass, ``unsolved`` for neither."""
    if value == "unsolved":
        return QueueModel.solved.is_(False)
    if value == "none":
        return QueueModel.passes.is_(True)
    return QueueModel.gate == _choice(term, value, GATES)


def _pictures(term: _Term, value: str) -> ColumnElement[bool]:
    """Whether views have a picture: ``none`` of them, ``any``, or ``all``."""
    choice = _choice(term, value, ("none", "any", "all"))
    if choice == "all":
        return QueueModel.pictures >= QueueModel.views
    return QueueModel.pictures == 0 if choice == "none" else QueueModel.pictures > 0


def _view(_term: _Term, value: str) -> ColumnElement[bool]:
    """A view's key (``cam3``, ``7_1.png``), or how many views there are."""
    if value.isascii() and value.isdigit():
        return QueueModel.views == int(value[:9])
    return _listed(QueueModel.view_keys, value)


def _match(_term: _Term, value: str) -> ColumnElement[bool]:
    return QueueModel.match.contains(value, autoescape=True)


def _text(_term: _Term, value: str) -> ColumnElement[bool]:
    return or_(
        QueueModel.label.contains(value, autoescape=True),
        QueueModel.key.contains(value, autoescape=True),
    )


def _exact(term: _Term, value: str) -> ColumnElement[bool]:
    column = EXACT[term.field]
    if value in ("any", "none"):
        missing = or_(column.is_(None), column == "")
        return missing if value == "none" else not_(missing)
    return and_(column.is_not(None), column == value)


_TESTS: dict[str, Callable[[_Term, str], ColumnElement[bool]]] = {
    "status": _status,
    "finding": _finding,
    "gate": _gate,
    "view": _view,
    "pictures": _pictures,
    "match": _match,
    "label": _text,
    "": _text,
    **dict.fromkeys(EXACT, _exact),
}
