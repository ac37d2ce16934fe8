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
from dataclasses import dataclass, field, replace
from difflib import get_close_matches
from hashlib import sha256

from app.errors import InputError
from app.features.batches.queries import select_place_in_batch
from app.features.queue import queries as conditions
from app.features.queue.fields import BY_NAME, FIELDS, ORDERS
from app.features.queue.queries import Condition, RowOrder
from app.json_text import MAX_ID

MAX_LENGTH = 1000
MAX_LISTED_LENGTH = 100_000
"""Of a query that comes in a body and lists groups one by one: about 15,000 ids."""
MAX_TERMS = 30

NUMBERS = {name: item.column for name, item in BY_NAME.items() if item.column}
"""Fields that compare with < <= > >= = and with :, which is =, by the column that they mean;
``none`` is where there is no number."""
SORTS = NUMBERS | {order.name: order.column for order in ORDERS}
"""What the queue can be sorted by, and the column of it."""

EXAMPLES = {
    "jac": "0.95", "agreement": "0.9", "error_percent": "0.2", "sigma": "0.5", "parallax": "10", "size_ratio": "1.2",
    "height": "2", "distance": "60", "box": "12", "x": "20", "y": "10", "margin": "0.1", "value": "0.1", "views": "3",
    "number": "100", "submissions": "2",
}  # fmt: skip
"""A usual value of each number; 1.5 of the others."""

_MISTAKEN = re.compile(r"(?P<field>[a-z_0-9]+)(?:(?P<open><=|>=|<|>|=|:)$|[~!≈≠≤≥])")
"""A field without a value, or with an operator that there is not."""
_REVERSE = "sort:name-desc is the reverse."
_TERM = re.compile(
    r"""\s*(?P<minus>-)?
        (?:(?P<field>[a-z_0-9]+)(?P<op><=|>=|<|>|=|:))?
        (?:"(?P<quoted>[^"]*)"|(?P<plain>[^\s"]+))(?=\s|$)""",
    re.VERBOSE,
)


@dataclass(frozen=True)
class Query:
    """A parsed query: conditions that must all hold, and a sort; that of ``batch`` without one.

    ``text`` is what was asked.
    """

    conditions: tuple[Condition, ...] = field(default=())
    sort: str = "number"
    descending: bool = False
    batch: int | None = None
    text: str = ""

    @property
    def digest(self) -> str:
        """Short digest of what was asked, whatever white space stands between the terms."""
        return sha256(" ".join(self.text.split()).encode()).hexdigest()[:16]

    @property
    def order(self) -> RowOrder:
        """The order in which it lists groups."""
        if self.batch is not None:
            return RowOrder(select_place_in_batch(self.batch))
        # "newest" says the direction itself.
        return RowOrder(SORTS[self.sort], self.descending != (self.sort == "newest"))


@dataclass(frozen=True)
class _QueryTerm:
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
    found: list[Condition] = []
    sort, descending, batch = "", False, None
    for negative, term in _parse_terms(text, longest):
        if term.field:
            _require_operator(term)
        if term.field == "sort":
            if negative:
                raise InputError(
                    "a sort order cannot be reversed with a minus sign",
                    hint=_REVERSE,
                    pointer=term.pointer,
                )
            sort, descending = _parse_sort(term)
        else:
            condition = _condition_of_term(term)
            if term.field == "batch" and not negative and "," not in term.value:
                batch = int(term.value)
            found.append(conditions.negate_condition(condition) if negative else condition)
    return Query(tuple(found), sort or "number", descending, None if sort else batch, text)


def _parse_terms(text: str, longest: int) -> Iterator[tuple[bool, _QueryTerm]]:
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
        yield (
            bool(found["minus"]),
            _QueryTerm(found["field"] or "", found["op"] or ":", value, pointer),
        )
        if not found["field"] and found["plain"]:
            _refuse_mistaken_term(value, pointer)
        place = found.end()


def _refuse_mistaken_term(word: str, pointer: str) -> None:
    """Refuse a word that begins as a field does and is none: nobody looks for that in a label."""
    found = _MISTAKEN.match(word)
    field_ = None if found is None else BY_NAME.get(found["field"])
    if found is None or field_ is None:
        return
    name = found["field"]
    problem = (
        f"{name} has no value"
        if found["open"]
        else f"{name} cannot be compared like that; it has {' and '.join(field_.operators)}"
    )
    raise InputError(problem, hint=f"For example {_make_example(name)}.", pointer=pointer)


def _make_example(name: str) -> str:
    """A term with a field, as somebody may write it."""
    field_ = BY_NAME[name]
    if field_.kind == "number":
        return f"{name}<{EXAMPLES.get(field_.name, '1.5')}"
    return f"{name}:{'12' if field_.kind == 'ids' else next(iter(field_.values), 'text')}"


def _parse_sort(term: _QueryTerm) -> tuple[str, bool]:
    name = term.value.removesuffix("-desc")
    if name not in SORTS:
        raise InputError(
            f'the queue cannot be sorted by "{term.value}"',
            hint=f"Sort orders are {', '.join(order.name for order in ORDERS)}, each also with"
            " -desc.",
            pointer=term.pointer,
        )
    return name, term.value.endswith("-desc")


def _require_operator(term: _QueryTerm) -> None:
    """Refuse a field that there is not, and an operator that a field has not."""
    field_ = BY_NAME.get(term.field)
    if field_ is None:
        nearest = get_close_matches(term.field, BY_NAME, n=1)
        meant = f"; did you mean {nearest[0]}?" if nearest else ""
        raise InputError(
            f'the queue has no field "{term.field}"{meant}',
            hint=f"Fields: {', '.join(item.name for item in FIELDS)}.",
            pointer=term.pointer,
        )
    if term.op not in field_.operators:
        raise InputError(
            f"{term.field} cannot be compared with {term.op}; it has {' and '.join(field_.operators)}",
            hint=f"For example {_make_example(term.field)}.",
            pointer=term.pointer,
        )


def _condition_of_term(term: _QueryTerm) -> Condition:
    field_ = BY_NAME.get(term.field)
    if field_ is not None and field_.name != term.field:
        term = replace(term, field=field_.name)
    if term.field in NUMBERS:
        return _number_condition(term)
    if term.field == "submissions" and term.value == "none":
        return conditions.has_annotation_count("=", 0)
    if term.field == "submissions":
        return conditions.has_annotation_count(
            "=" if term.op == ":" else term.op, _parse_number(term)
        )
    if term.field == "id":
        return conditions.has_group_id(_parse_id(term, text) for text in term.value.split(","))
    if term.field == "batch":
        return conditions.is_in_batch(_parse_id(term, text) for text in term.value.split(","))
    if field_ is not None and field_.kind == "flag":
        return conditions.flag_condition(term.field, _require_choice(term, term.value) == "yes")
    test = _TESTS[term.field]
    # A bare word may hold commas; a field's value is a list of choices.
    values = [term.value] if term.field == "" else term.value.split(",")
    return conditions.any_condition(test(term, value) for value in values)


def _parse_id(term: _QueryTerm, text: str) -> int:
    what = "batch" if term.field == "batch" else "group"
    digits = text.isascii() and text.isdigit() and len(text) <= len(str(MAX_ID))
    if not digits or not 1 <= int(text) <= MAX_ID:
        raise InputError(
            f'"{text[:40]}" is not the id of a {what}',
            hint=f"For example {term.field}:12,15,19; the id of a {what} is the number in the URL"
            " of its page.",
            pointer=term.pointer,
        )
    return int(text)


def _number_condition(term: _QueryTerm) -> Condition:
    column = NUMBERS[term.field]
    if term.value == "none":
        return conditions.absent_condition(column)
    return conditions.compare_condition(
        column, "=" if term.op == ":" else term.op, _parse_number(term)
    )


def _parse_number(term: _QueryTerm) -> float:
    try:
        value = float(term.value)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        hint = f"For example {_make_example(term.field)}, or {term.field}:none."
        if "," in term.value:
            hint += " Numbers have a decimal point."
        raise InputError(
            f'"{term.value}" is not a number',
            hint=hint,
            pointer=term.pointer,
        )
    return value


def _require_choice(term: _QueryTerm, value: str) -> str:
    choices = BY_NAME[term.field].values
    if value not in choices:
        raise InputError(
            f'{term.field} cannot be "{value}"',
            hint=f"It is one of {', '.join(choices)}.",
            pointer=term.pointer,
        )
    return value


def _any_or_none_condition(value: str, some: Condition) -> Condition:
    """``some``; the opposite for ``none``."""
    return conditions.negate_condition(some) if value == "none" else some


def _status_condition(term: _QueryTerm, value: str) -> Condition:
    return conditions.compare_condition("status", "=", _require_choice(term, value))


def _finding_condition(term: _QueryTerm, value: str) -> Condition:
    column = "dismissed" if term.field == "dismissed" else "findings"
    if value in ("any", "none"):
        return conditions.compare_condition(column, "=" if value == "none" else ">", "")
    return conditions.has_list_item(column, _require_choice(term, value))


def _gate_condition(term: _QueryTerm, value: str) -> Condition:
    """The first failing gate; ``none`` for groups that pass, ``unsolved`` for neither."""
    if value == "unsolved":
        return conditions.flag_condition("solved", False)
    if value == "none":
        return conditions.flag_condition("passes", True)
    return conditions.text_condition("gate", _require_choice(term, value))


def _pictures_condition(term: _QueryTerm, value: str) -> Condition:
    """Whether views have a picture: ``none`` of them, ``any``, or ``all``."""
    choice = _require_choice(term, value)
    if choice == "all":
        return conditions.has_all_pictures()
    return conditions.compare_condition("pictures", "=" if choice == "none" else ">", 0)


def _proposal_condition(term: _QueryTerm, value: str) -> Condition:
    """What was proposed for a view that has no camera yet."""
    choice = _require_choice(term, value)
    if choice in ("any", "none"):
        return _any_or_none_condition(choice, conditions.has_open_proposal())
    return conditions.has_open_proposal(choice)


def _comments_condition(term: _QueryTerm, value: str) -> Condition:
    """Whether people say something to each other about it, and whether that is settled."""
    choice = _require_choice(term, value)
    if choice in ("any", "none"):
        return _any_or_none_condition(choice, conditions.has_thread())
    return conditions.has_thread(choice)


def _independent_annotations_condition(term: _QueryTerm, value: str) -> Condition:
    """What people's own annotations of it came to."""
    choice = _require_choice(term, value)
    if choice in ("any", "none"):
        return _any_or_none_condition(choice, conditions.has_annotation_count(">", 0))
    return conditions.has_comparison_outcome("open" if choice == "waiting" else choice)


def _mentions_condition(_term: _QueryTerm, value: str) -> Condition:
    """The people whom an open thread mentions."""
    if value in ("any", "none"):
        return _any_or_none_condition(value, conditions.mentions_person())
    return conditions.mentions_person(value.lower())


def _view_condition(_term: _QueryTerm, value: str) -> Condition:
    """A view's key (``cam3``, ``7_1.png``), or how many views there are."""
    if value.isascii() and value.isdigit():
        return conditions.compare_condition("views", "=", int(value[:9]))
    return conditions.has_list_item("view_keys", value)


def _match_name_condition(_term: _QueryTerm, value: str) -> Condition:
    return conditions.contains_text_condition("match", value)


def _text_condition(_term: _QueryTerm, value: str) -> Condition:
    return conditions.any_condition(
        (
            conditions.contains_text_condition("label", value),
            conditions.contains_text_condition("key", value),
        )
    )


def _exact_text_condition(term: _QueryTerm, value: str) -> Condition:
    if value in ("any", "none"):
        missing = conditions.empty_text_condition(term.field)
        return missing if value == "none" else conditions.negate_condition(missing)
    return conditions.text_condition(term.field, value)


_TESTS: dict[str, Callable[[_QueryTerm, str], Condition]] = {
    "status": _status_condition,
    "finding": _finding_condition,
    "dismissed": _finding_condition,
    "gate": _gate_condition,
    "view": _view_condition,
    "pictures": _pictures_condition,
    "proposal": _proposal_condition,
    "comments": _comments_condition,
    "mentions": _mentions_condition,
    "annotations": _independent_annotations_condition,
    "match": _match_name_condition,
    "label": _text_condition,
    "": _text_condition,
    **dict.fromkeys(("split", "key", "reviewer", "reason", "override"), _exact_text_condition),
}
