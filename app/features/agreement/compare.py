"""Several annotations of the same frames beside each other, and how far they may lie apart."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from itertools import combinations

from app.db.log import Entry, append
from app.db.session import Session, now
from app.db.store import Store
from app.errors import InputError
from app.evaluation.agreement_limits import AgreementLimits, Disagreement, disagreements
from app.evaluation.annotation_distance import GroupDistance, compare_annotations
from app.features.agreement.queries import limits_of, put_limits
from app.features.datasets.service import dataset_id
from app.features.groups.state import GroupState
from app.features.groups.submit import load_solved


@dataclass(frozen=True)
class AnnotationPair:
    """Two of several annotations, by their places in the list, from 0.

    Attributes:
        distance: How far they lie apart.
        disagreements: What goes beyond the limits, the worst first.
    """

    a: int
    b: int
    distance: GroupDistance
    disagreements: tuple[Disagreement, ...]


@dataclass(frozen=True)
class Comparison:
    """Annotations of the same frames.

    Attributes:
        states: The groups, solved.
        pairs: Every two of them, those that disagree most first.
        limits: How far they may lie apart.
        worst_views: Keys of the views, the one with most to look at first.
    """

    states: tuple[GroupState, ...]
    pairs: tuple[AnnotationPair, ...]
    limits: AgreementLimits
    worst_views: tuple[str, ...]


def compare_groups(store: Store, group_ids: Sequence[int], limits: AgreementLimits) -> Comparison:
    """Groups of the same frames beside each other; saves nothing.

    Raises:
        NotFoundError: There is no such group.
        InputError: They have no view in common.
    """
    return compare_states([load_solved(store, number) for number in group_ids], limits)


def compare_states(states: Sequence[GroupState], limits: AgreementLimits) -> Comparison:
    """The same of groups that are read already.

    Raises:
        InputError: Two of them have no view in common.
    """
    pairs = []
    for a, b in combinations(range(len(states)), 2):
        first, second = states[a], states[b]
        distance = compare_annotations(first.group, second.group, first.solution, second.solution)
        if not distance.views:
            raise InputError(
                f"{first.key} and {second.key} have no view in common",
                hint="Compare two annotations of the same frames.",
                pointer="/with",
            )
        verdicts = (_verdict_of(first), _verdict_of(second))
        pairs.append(AnnotationPair(a, b, distance, disagreements(distance, verdicts, limits)))
    pairs.sort(key=lambda pair: (-_largest_weight(pair.disagreements), -len(pair.disagreements)))
    return Comparison(tuple(states), tuple(pairs), limits, _worst_views(states, pairs))


def _verdict_of(state: GroupState) -> str | None:
    verdict = state.verdict.state
    return None if verdict == "unreviewed" else verdict


def _largest_weight(found: Sequence[Disagreement]) -> float:
    return max((item.weight for item in found), default=0.0)


def _worst_views(states: Sequence[GroupState], pairs: Sequence[AnnotationPair]) -> tuple[str, ...]:
    """Views by the weight of what is said of them, then by the largest distance in them."""
    order: dict[str, tuple[float, float]] = {view.key: (0, 0) for view in states[0].group.views}
    for pair in pairs:
        for view in pair.distance.views:
            in_view = [item for item in pair.disagreements if item.view == view.view]
            weight, apart = order.get(view.view, (0.0, 0.0))
            order[view.view] = (max(weight, _largest_weight(in_view)), max(apart, view.largest_px))
    return tuple(sorted(order, key=lambda key: [-value for value in order[key]]))


KIND = "agreement"
"""Kind of the log's entries about agreement; they change no group."""


def read_limits(session: Session, dataset: int) -> AgreementLimits:
    """The limits of a dataset, by its id; the defaults where nobody has set any."""
    row = limits_of(session, dataset)
    return AgreementLimits() if row is None else AgreementLimits(**row._mapping)


def set_limits(
    store: Store, dataset: str | int, limits: AgreementLimits, *, actor: str
) -> AgreementLimits:
    """Let other limits count for whatever is submitted from now on."""
    number, at = dataset_id(store, dataset), now()
    with store.write() as session:
        put_limits(session, number, {**asdict(limits), "changed": at, "changed_by": actor})
        append(session, [Entry(KIND, actor, at, {"did": "limits", **asdict(limits)}, number)])
        session.respond(limits)
    return limits
