"""Summary: how far the people of a dataset agree, in verdicts, pixels and metres."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

from app.db.json_columns import decompress_json
from app.db.store import Store
from app.evaluation.rater_agreement import (
    MEASURES,
    AgreementCoefficient,
    AgreementLimits,
    MedianAndTail,
    cohen_kappa,
    compute_medians_and_tails,
    fleiss_kappa,
    krippendorff_alpha,
)
from app.features.agreement.queries import AGREED, DECIDED, OPEN, AgreementRow, list_agreements
from app.features.agreement.service import StoredAnnotationPair, StoredComparison, read_limits
from app.features.datasets.service import dataset_id
from app.features.solutions.codec import from_json
from app.formats.csv_text import format_csv_line


@dataclass(frozen=True)
class PeopleAgreement:
    """How far two people agree, or all of them.

    Attributes:
        people: Names, sorted.
        groups: Groups that they annotated alike.
        kappa: Cohen's of two; Fleiss' of more, where every group was judged by equally many.
        spreads: Median and bad end of each measure.
    """

    people: tuple[str, ...]
    groups: int
    kappa: AgreementCoefficient | None
    spreads: Mapping[str, MedianAndTail]


@dataclass(frozen=True)
class GroupAgreement:
    """What one group came to.

    Attributes:
        worst: How many times its limit the worst disagreement was.
        status: The verdict on the group itself: annotations that agree without one leave it unreviewed.
        taken: Whose annotation was taken over; None: nobody's yet.
    """

    group: int
    number: int
    batch: int | None
    state: str
    status: str
    people: tuple[str, ...]
    verdicts: tuple[str | None, ...]
    worst: float
    disagreements: int
    spreads: Mapping[str, MedianAndTail]
    outcome: str | None
    taken: str | None
    decided: str | None
    decided_by: str | None


@dataclass(frozen=True)
class DatasetAgreement:
    """How far people agree in a dataset, or in one batch of it.

    Attributes:
        agreed, open, decided: How many groups settled themselves, wait, and were decided.
        alpha: Krippendorff's, of whoever judged whatever.
        pairs: Of every two people, those with most groups first.
        groups: The worst first.
    """

    agreed: int
    open: int
    decided: int
    limits: AgreementLimits
    alpha: AgreementCoefficient
    overall: PeopleAgreement
    pairs: list[PeopleAgreement]
    groups: list[GroupAgreement]


@dataclass(frozen=True)
class _ComparedGroup:
    """A row with its pairs as they were kept."""

    row: AgreementRow
    pairs: tuple[StoredAnnotationPair, ...]

    @property
    def verdicts(self) -> dict[str, str | None]:
        """The verdict of each person, in the order of their names."""
        verdicts: dict[str, str | None] = {}
        for pair in self.pairs:
            verdicts |= dict(zip(pair.people, pair.verdicts, strict=True))
        return dict(sorted(verdicts.items()))


def summarize_agreement(
    store: Store, dataset: str | int, batch: int | None = None
) -> DatasetAgreement:
    """How far people agree in a dataset.

    Args:
        store: The database.
        dataset: The dataset.
        batch: One batch alone; None: all, and what belongs to none.
    """
    number = dataset_id(store, dataset)
    with store.read() as session:
        rows = list_agreements(session, number, batch_id=batch)
        limits = read_limits(session, number)
    read = [
        _ComparedGroup(row, from_json(StoredComparison, decompress_json(row.pairs)).pairs)
        for row in rows
    ]
    states = [row.state for row in rows]
    people = sorted({name for one in read for name in one.verdicts})
    judged = [[one.verdicts.get(name) for name in people] for one in read]
    pairs = [
        found
        for two in combinations(people, 2)
        if (found := _summarize_pair_agreement(two, read)) is not None
    ]
    return DatasetAgreement(
        states.count(AGREED),
        states.count(OPEN),
        states.count(DECIDED),
        limits,
        krippendorff_alpha(judged),
        _summarize_overall_agreement(people, read),
        sorted(pairs, key=lambda one: (-one.groups, one.people)),
        [_summarize_group_agreement(one) for one in read],
    )


def agreement_to_csv(found: DatasetAgreement) -> str:
    """A row for each group, the worst first; text that would be a formula is none."""
    names = [f"{name}_{end}" for name in MEASURES for end in ("median", "tail")]
    head = (
        "number",
        "group",
        "batch",
        "state",
        "status",
        "people",
        "verdicts",
        "disagreements",
        "worst",
    )
    tail = ("outcome", "taken", "decided", "decided_by")
    lines = [format_csv_line((*head, *names, *tail))]
    for one in found.groups:
        numbers = [
            value
            for name in MEASURES
            for value in (one.spreads[name].median, one.spreads[name].tail)
        ]
        values = (
            *(one.number, one.group, one.batch, one.state, one.status),
            *("; ".join(one.people), "; ".join(verdict or "none" for verdict in one.verdicts)),
            *(one.disagreements, one.worst),
            *numbers,
            *(one.outcome, one.taken, one.decided, one.decided_by),
        )
        lines.append(format_csv_line(values))
    return "".join(lines)


def _summarize_pair_agreement(
    two: tuple[str, str], read: Sequence[_ComparedGroup]
) -> PeopleAgreement | None:
    found = [pair for one in read for pair in one.pairs if tuple(sorted(pair.people)) == two]
    if not found:
        return None
    verdicts = [dict(zip(pair.people, pair.verdicts, strict=True)) for pair in found]
    both = [(one[two[0]], one[two[1]]) for one in verdicts]
    both = [(a, b) for a, b in both if a is not None and b is not None]
    kappa = cohen_kappa([a for a, _ in both], [b for _, b in both])
    return PeopleAgreement(
        two, len(found), kappa, compute_medians_and_tails(pair.distance for pair in found)
    )


def _summarize_overall_agreement(
    people: Sequence[str], read: Sequence[_ComparedGroup]
) -> PeopleAgreement:
    verdicts = [[value for value in one.verdicts.values() if value is not None] for one in read]
    verdicts = [values for values in verdicts if len(values) > 1]
    equal = len({len(values) for values in verdicts}) == 1
    kappa = fleiss_kappa(verdicts) if equal else None
    return PeopleAgreement(
        tuple(people),
        len(read),
        kappa,
        compute_medians_and_tails(pair.distance for one in read for pair in one.pairs),
    )


def _summarize_group_agreement(one: _ComparedGroup) -> GroupAgreement:
    row = one.row
    people: dict[int, str] = defaultdict(str)
    for pair in one.pairs:
        people |= {pair.a: pair.people[0], pair.b: pair.people[1]}
    return GroupAgreement(
        row.group_id,
        row.number,
        row.batch_id or None,
        row.state,
        row.status,
        tuple(one.verdicts),
        tuple(one.verdicts.values()),
        row.worst,
        row.disagreements,
        compute_medians_and_tails(pair.distance for pair in one.pairs),
        row.outcome,
        None if row.take_id is None else people[row.take_id],
        row.decided,
        row.decided_by,
    )
