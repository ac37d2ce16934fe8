"""Fields: what a query can ask of a group, in one table for the parser, the documents and the browser."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Literal, get_args

from app.soccer.choices import VerdictState
from app.soccer.finding import FINDING_KINDS
from app.soccer.group import REASONS
from app.soccer.paint_evidence import PROPOSAL_OUTCOMES
from app.soccer.solution import GATES

FieldKind = Literal["number", "flag", "choice", "text", "ids", "order"]
COMPARED = (":", "=", "<", "<=", ">", ">=")
NAMED = (":", "=")


@dataclass(frozen=True)
class QueryField:
    """One field of a query.

    Attributes:
        kind: ``number`` compares, ``flag`` is yes or no, ``choice`` one of ``values``, ``text`` any
            text, ``ids`` numbers of groups, ``order`` says how the groups are listed.
        unit: Of a number.
        values: What it can be, or, of a text, words that mean something of their own.
        also: Other names that are understood.
        column: Of the queue.
    """

    name: str
    kind: FieldKind
    meaning: str
    unit: str = ""
    values: tuple[str, ...] = ()
    also: tuple[str, ...] = ()
    column: str = ""

    @property
    def operators(self) -> tuple[str, ...]:
        """The operators that it has; ``:`` and ``=`` mean the same."""
        return COMPARED if self.kind == "number" else NAMED

    @property
    def several(self) -> bool:
        """Whether ``a,b`` means either."""
        return self.kind in ("choice", "text", "ids")


@dataclass(frozen=True)
class QueryOrder:
    """One order of a list; ``name-desc`` is its reverse. What has no value comes last in both."""

    name: str
    column: str
    meaning: str


STATUSES: tuple[str, ...] = get_args(VerdictState)
YES_NO = ("yes", "no")
WHETHER = ("any", "none")


def _make_number_field(
    name: str, column: str, meaning: str, unit: str = "", *also: str
) -> QueryField:
    others = (*also, column) if column != name else also
    return QueryField(name, "number", meaning, unit, ("none",), others, column)


def _make_text_field(name: str, meaning: str, values: tuple[str, ...] = WHETHER) -> QueryField:
    return QueryField(name, "text", meaning, values=values)


def _make_flag_field(name: str, meaning: str) -> QueryField:
    return QueryField(name, "flag", meaning, values=YES_NO)


_HIDDEN_FIELDS = (
    QueryField("status", "choice", "verdict", values=STATUSES, also=("state",)),
    QueryField(
        "finding", "choice", "kind of finding, unless dismissed", values=(*WHETHER, *FINDING_KINDS)
    ),
    QueryField(
        "dismissed", "choice", "kind of dismissed finding", values=(*WHETHER, *FINDING_KINDS)
    ),
    QueryField(
        "gate", "choice", "first failing gate; none: it passes", values=("none", "unsolved", *GATES),
        also=("first_failing",),
    ),
    QueryField("reason", "text", "why it was rejected", values=(*WHETHER, *REASONS)),
    _make_flag_field("stale", "changed after its verdict"),
    _make_flag_field("solved", "is solved"),
    _make_flag_field("passes", "passes every gate"),
    _make_flag_field("fixed", "edited before it was accepted"),
    QueryField("pictures", "choice", "whether its views have a picture", values=("none", "any", "all")),
    QueryField(
        "proposal", "choice", "what was proposed from a view's paint, until its lines change",
        values=(*WHETHER, *PROPOSAL_OUTCOMES),
    ),
    _make_text_field("split", "train, test and so on, the whole name"),
    _make_text_field("match", "part of the match's name", ()),
    _make_text_field("reviewer", "person who decided"),
    _make_text_field("view", "key of a view, or how many views there are", ()),
    _make_text_field("label", "part of the label or of the key, like a word without a field", ()),
    _make_text_field("key", "key of the group, the whole key"),
    _make_text_field("override", "gate that an acceptance overrides"),
    QueryField(
        "comments", "choice", "comments on it",
        values=(*WHETHER, "open", "resolved"),
    ),
    _make_text_field("mentions", "person mentioned in an open comment, by name"),
    QueryField(
        "annotations", "choice",
        "result of its independent annotations; waiting: they differ and need a decision (reviewers)",
        values=(*WHETHER, "agreed", "waiting", "decided"),
    ),
    QueryField(
        "submissions", "number", "how many independent annotations were submitted (reviewers)",
        values=("none",), also=("takes",),
    ),
    QueryField("id", "ids", "groups one by one: id:12,15,19"),
    QueryField("batch", "ids", "assigned work: batch:3, in its order unless another is given"),
    _make_number_field("jac", "min_jac", "smallest JaC of the views in use at 0.5 %, 0 to 1", "", "jac05"),
    _make_number_field(
        "agreement", "agreement",
        "least agreement of the views' cameras with their paint, 0 to 1; none: no paint was read",
    ),
    _make_number_field("error", "error_px", "larger reprojection error of the best pair, as its gate judges it", "px"),
    _make_number_field("error_percent", "error_percent", "the same error", "% of the image diagonal"),
    _make_number_field("sigma", "sigma_m", "standard deviation of the ball along its worst axis", "m"),
    _make_number_field("parallax", "parallax_degrees", "largest angle between two rays at the ball", "degrees"),
    _make_number_field("size_ratio", "size_ratio", "diameter of the ball's box by the expected one", "", "ratio"),
    _make_number_field("height", "height_m", "ball above the grass", "m"),
    _make_number_field("distance", "distance_m", "from the camera of the first view to the ball", "m"),
    _make_number_field("box", "box_px", "diameter of the ball's box in the first view that shows it", "px"),
    _make_number_field("x", "x_m", "ball along the pitch, from its centre to the right", "m"),
    _make_number_field("y", "y_m", "ball across the pitch, from its centre to the main camera", "m"),
    _make_number_field(
        "margin", "margin",
        "how far the deciding gate is from its threshold: 0.1 is 10 % of it, below 0 fails", "share",
    ),
    _make_number_field(
        "value", "value", "the margin without its sign: small where a small change decides", "share"
    ),
    _make_number_field("views", "views", "how many views"),
    _make_number_field("number", "number", "place in the dataset, from 1"),
)  # fmt: skip

ORDERS = (
    QueryOrder("value", "value", "closest to a gate's threshold first"),
    QueryOrder("newest", "changed", "changed last first; `newest-desc` the other way round"),
    QueryOrder("sigma", "sigma_m", "most certain first"),
    QueryOrder("jac", "min_jac", "smallest first"),
    QueryOrder("agreement", "agreement", "smallest first"),
    QueryOrder("error", "error_px", "smallest first"),
    QueryOrder("error_percent", "error_percent", "smallest first"),
    QueryOrder("parallax", "parallax_degrees", "smallest first"),
    QueryOrder("margin", "margin", "failing by most first"),
    QueryOrder("ratio", "size_ratio", "box smallest beside what is expected first"),
    QueryOrder("height", "height_m", "lowest first"),
    QueryOrder("distance", "distance_m", "nearest first"),
    QueryOrder("box", "box_px", "smallest first"),
    QueryOrder("x", "x_m", "leftmost first"),
    QueryOrder("y", "y_m", "farthest from the main camera first"),
    QueryOrder("views", "views", "fewest first"),
    QueryOrder("findings", "findings", "fewest kinds of findings first"),
    QueryOrder("gate", "gate", "by the first failing gate, in the order in which they are judged"),
    QueryOrder("status", "status", "by letters"),
    QueryOrder("split", "split", "by letters"),
    QueryOrder("reviewer", "reviewer", "by letters"),
    QueryOrder("label", "label", "by letters"),
    QueryOrder("number", "number", "as in the dataset; the default order"),
)
"""Equal groups stand as in the dataset."""

FIELDS = (
    *_HIDDEN_FIELDS,
    QueryField(
        "sort", "order", "order of the list",
        values=tuple(text for order in ORDERS for text in (order.name, f"{order.name}-desc")),
    ),
)  # fmt: skip
BLIND = ("annotations", "submissions", "takes")
"""Fields that tell what others made of a group: for those alone who judge."""
_BLIND = re.compile(rf"\b({'|'.join(BLIND)})[:=<>]")
BY_NAME = {name: field for field in FIELDS for name in (field.name, *field.also)}
"""Fields by every name that is understood."""


def query_reveals_hidden_work(query: str) -> bool:
    """Whether a query asks what others made of groups; also within quotes: rather once too often.

    Example:
        >>> [query_reveals_hidden_work(text) for text in ("status:accepted submissions>=2", "sort:value")]
        [True, False]
    """
    return _BLIND.search(query) is not None
