"""The noise of a dataset.

It is estimated from its own residuals, put into its policy, and kept until something changes.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from threading import Lock

import numpy as np

from app.db.log import find_newest_entry_id
from app.db.session import Session
from app.db.store import Store
from app.errors import InputError
from app.features.datasets.service import read_dataset_head, require_dataset_id, save_policy
from app.features.groups.group_edits import apply_noise_factors, read_last_ball_actors
from app.features.groups.state import GroupState, read_states
from app.features.independent_annotations.queries import is_copy_dataset
from app.features.match_estimates.queries import (
    Factors,
    NoiseFactor,
    find_noise_factor,
    read_noise_factors,
)
from app.features.policies.service import (
    CUSTOM,
    PolicyState,
    apply_policy,
    read_policy,
    replace_thresholds,
    require_policy_etag,
)
from app.features.solutions.queries import find_newest_solution_id, list_solved_groups
from app.soccer.policy import CALIBRATION, ESTIMATED, POLICIES, Policy
from app.soccer.thresholds import THRESHOLDS
from app.solving.ball_noise import BallNoise, RayResidual, SigmaEstimate
from app.solving.dataset_noise import (
    BallSource,
    DatasetNoise,
    GroupNoiseInputs,
    SourceNoise,
    SourceNoiseFactors,
    estimate_noise,
    estimate_source_noise,
)
from app.solving.line_noise import LineEstimate

MAX_GROUPS = 600
"""Groups that an estimate looks at, spread over the dataset: more say hardly more."""
CHUNK = 100
DECIMALS = 2
NEAR, NEAR_SHARE = 0.05, 0.02
"""Of a sigma that is followed, and of a share: a smaller change is none."""
WANDER = 0.1
"""Of a factor: a smaller change is none."""


ASSUMED_WORDS = "The policy assumes the noise of clicks, and does not estimate it."
ESTIMATED_WORDS = "The policy uses the estimates, as they were when the dataset was last solved."


@dataclass(frozen=True)
class ThresholdAdvice:
    """A threshold of the policy, what it is, and what the dataset says of it.

    Attributes:
        present: None where the policy leaves it to each image.
    """

    name: str
    label: str
    unit: str
    present: float | None
    estimate: float
    low: float
    high: float

    @property
    def agrees(self) -> bool:
        """Whether the interval holds the present value."""
        return self.present is not None and self.low <= self.present <= self.high

    @property
    def differs_from_present(self) -> bool:
        """Whether an estimate that is followed is another by now than the present value."""
        if self.present is None:
            return True
        near = NEAR_SHARE if not self.short_unit else NEAR * self.present
        return abs(self.estimate - self.present) > near

    @property
    def short_unit(self) -> str:
        """As it follows a number in a sentence: a share has none."""
        return " px" if self.unit.startswith("px") else ""


@dataclass(frozen=True)
class NoiseReport:
    """What the residuals of a dataset say about its noise.

    Attributes:
        groups: Groups that were looked at, of ``solved`` ones.
        stations: Noise of the balls of static cameras of which enough is seen.
        people: The same for the people who placed the balls last.
        factors: How noisy balls of both together are, where anything is unlike the dataset.
        used: The factors that the views of the dataset carry.
        follows: Whether the policy takes the estimates over with each solve of the dataset.
        advice: Thresholds of the policy that the dataset says something about.
        notices: Sentences for people: what disagrees, and why nothing is known.
    """

    dataset_id: int
    dataset: str
    groups: int
    solved: int
    ball: BallNoise
    stations: tuple[SourceNoise, ...]
    people: tuple[SourceNoise, ...]
    factors: Factors
    used: Factors
    line_estimate: LineEstimate | None
    follows: bool
    advice: tuple[ThresholdAdvice, ...]
    notices: tuple[str, ...]

    @property
    def values(self) -> dict[str, float]:
        """The thresholds that would make the policy agree, without those that do already."""
        return {
            item.name: item.estimate
            for item in self.advice
            if (item.differs_from_present if self.follows else not item.agrees)
        }

    @property
    def is_new(self) -> bool:
        """Whether cameras or people are unlike the dataset in another way than its views carry."""
        return _differ_noticeably(self.factors, self.used)


def estimate_dataset_noise(store: Store, dataset: str | int) -> NoiseReport:
    """The noise that the present solutions of a dataset show; changes nothing.

    Raises:
        NotFoundError: There is no such dataset.
    """
    state = read_policy(store, dataset)
    ids = _solved_group_ids(store, state.dataset_id)
    groups, sources, noise = _estimate_noise(store, ids, state.policy)
    misses = zip(noise.misses, sources, strict=True)
    found = _estimate_source_factors(
        [(miss, own) for some, own in misses for miss in some], noise.ball, state.policy
    )
    with store.read() as session:
        used = read_noise_factors(session, state.dataset_id)
    advice = _make_advice(noise, state.policy)
    return NoiseReport(
        dataset_id=state.dataset_id,
        dataset=state.dataset,
        groups=groups,
        solved=len(ids),
        ball=noise.ball,
        stations=found.noise_of_kind("camera"),
        people=found.noise_of_kind("person"),
        factors=_factors_by_camera_and_person(found),
        used=used,
        line_estimate=noise.lines,
        follows=state.policy.noise == ESTIMATED,
        advice=advice,
        notices=tuple(_describe_notices(advice, state.policy)),
    )


def choose_noise_sample(ids: Sequence[int]) -> Sequence[int]:
    """The groups of a dataset that its noise is estimated from, in its order."""
    return ids[:: max(-(-len(ids) // MAX_GROUPS), 1)]


def is_noise_estimated_when_solving(store: Store, dataset: str | int) -> bool:
    """Whether solving a dataset estimates its noise.

    Somebody's own copies have the numbers of what they are of.
    """
    with store.read() as session:
        found = read_dataset_head(session, dataset)
        return found.policy.noise == ESTIMATED and not is_copy_dataset(session, found.id)


def update_policy_noise(store: Store, dataset: str | int, actor: str) -> bool:
    """Let the policy of a dataset, whose noise is ``estimated``, have what the dataset shows now.

    A change too small to matter is none: the groups would all be solved again.

    Returns:
        Whether the policy changed, and everything is stale.
    """
    state = read_policy(store, dataset)
    noise = _estimate_noise(store, _solved_group_ids(store, state.dataset_id), state.policy)[2]
    advice = _make_advice(noise, state.policy)
    if not any(item.differs_from_present for item in advice):
        return False
    values = {item.name: item.estimate for item in advice}
    policy = replace_thresholds(
        state.policy, {"noise": ESTIMATED, **values}, name=state.policy.name
    )
    with store.write() as session:
        # Where somebody chose another one meanwhile, its own solve looks again.
        if read_dataset_head(session, state.dataset_id).policy == state.policy:
            save_policy(session, state.dataset_id, policy, actor)
    return True


def adopt_estimated_noise(store: Store, noise: NoiseReport, *, actor: str) -> PolicyState:
    """Judge the dataset with the noise that was estimated, of it and of its cameras and people.

    Raises:
        InputError: The dataset says nothing about its noise, or nothing new.
    """
    if not noise.values and not noise.is_new:
        raise InputError(f'the noise measured in "{noise.dataset}" is what its policy already uses')
    state = read_policy(store, noise.dataset_id)
    with store.write() as session:
        adopt_estimated_noise_in_session(session, noise, state, actor)
    return read_policy(store, noise.dataset_id)


def adopt_estimated_noise_in_session(
    session: Session, noise: NoiseReport, state: PolicyState, actor: str
) -> None:
    """``adopt_estimated_noise`` within a write session; where nothing is new nothing changes.

    Raises:
        StaleRevisionError: The policy is another by now.
    """
    if noise.values and state.policy.noise == ESTIMATED:
        require_policy_etag(session, noise.dataset_id, state.etag)
        policy = replace_thresholds(state.policy, {"noise": ESTIMATED, **noise.values})
        save_policy(session, noise.dataset_id, policy, actor)
    elif noise.values:
        name = CUSTOM if state.policy.name in POLICIES else state.policy.name
        policy = replace_thresholds(state.policy, noise.values, name=name)
        apply_policy(session, noise.dataset_id, policy, if_match=state.etag, actor=actor)
    if noise.is_new:
        apply_noise_factors(session, noise.dataset_id, noise.factors, actor)


def reset_noise_factors(session: Session, dataset: str | int, *, actor: str) -> int:
    """Take all balls to be as noisy as their dataset's, in a write session; how many groups change.

    Raises:
        NotFoundError: There is no such dataset.
    """
    return apply_noise_factors(session, require_dataset_id(session, dataset), (), actor)


def _solved_group_ids(store: Store, dataset_id: int) -> list[int]:
    """Ids of the groups that have a solution, in the dataset's order."""
    with store.read() as session:
        return list_solved_groups(session, dataset_id)


def _groups_with_ball_actors(
    store: Store, chosen: Sequence[int]
) -> Iterator[tuple[GroupState, Mapping[str, str]]]:
    """Groups, and who placed the ball of each view last, as far as somebody did."""
    for start in range(0, len(chosen), CHUNK):
        batch = chosen[start : start + CHUNK]
        with store.read() as session:
            states = read_states(session, batch)
            placed = read_last_ball_actors(session, batch)
        yield from ((state, placed.get(state.id, {})) for state in states)


def _find_ball_sources(state: GroupState, placed: Mapping[str, str]) -> dict[str, list[BallSource]]:
    """The static camera of each view, and who placed its ball, by the view's key."""
    found: dict[str, list[BallSource]] = {}
    for view in state.group.views:
        camera = [BallSource("camera", view.station.key)] if view.station.shared else []
        person = [BallSource("person", placed[view.key])] if view.key in placed else []
        found[view.key] = camera + person
    return found


def _estimate_source_factors(
    seen: Sequence[tuple[RayResidual, Mapping[str, Sequence[BallSource]]]],
    ball: BallNoise,
    policy: Policy,
) -> SourceNoiseFactors:
    """Noise of the sources of some views, beside what is known of the dataset."""
    click = policy.click_sigma_px if ball.click is None else ball.click.value
    share = policy.box_sigma_share if ball.share is None else ball.share
    given = policy.given_sigma_px if ball.given is None else ball.given.value
    return estimate_source_noise(seen, click, share, given)


def _factors_by_camera_and_person(found: SourceNoiseFactors) -> Factors:
    """Of each camera that is told with each person that is; none where all may be alike."""
    cameras, people = (
        ["", *(source.name for source in found.sources if source.kind == kind)]
        for kind in ("camera", "person")
    )
    factors = []
    for camera in cameras:
        for person in people:
            sources = (BallSource("camera", camera), BallSource("person", person))
            factors.append(NoiseFactor(camera or None, person or None, found.noise_factor(sources)))
    return tuple(factors) if any(item.ratio != 1 for item in factors) else ()


def _differ_noticeably(wanted: Factors, used: Factors) -> bool:
    """Whether factors differ by more than their estimate wanders with every new ball."""
    places = {item[:2] for item in (*wanted, *used)}
    ratios = [(find_noise_factor(wanted, *at), find_noise_factor(used, *at)) for at in places]
    return any(abs(new / old - 1) > WANDER for new, old in ratios)


def _estimate_noise(
    store: Store, ids: Sequence[int], policy: Policy
) -> tuple[int, list[Mapping[str, Sequence[BallSource]]], DatasetNoise]:
    """How many groups were asked, the sources of the balls of each, and what all of them say."""
    seen: list[GroupNoiseInputs] = []
    sources: list[Mapping[str, Sequence[BallSource]]] = []
    for state, placed in _groups_with_ball_actors(store, choose_noise_sample(ids)):
        if state.solution is not None:
            seen.append(GroupNoiseInputs.of(state.group, state.solution, state.policy))
            sources.append(_find_ball_sources(state, placed))
    return len(seen), sources, estimate_noise(seen, policy)


def _make_advice(noise: DatasetNoise, policy: Policy) -> tuple[ThresholdAdvice, ...]:
    return (*_ball_advice(noise.ball, policy), *_line_advice(noise.lines, policy))


def _ball_advice(ball: BallNoise, policy: Policy) -> Iterator[ThresholdAdvice]:
    if ball.click is not None:
        yield _threshold_advice("click_sigma_px", _make_interval(ball.click), policy)
    if ball.share is not None and ball.share_interval is not None:
        yield _threshold_advice("box_sigma_share", (ball.share, *ball.share_interval), policy)
    if ball.given is not None:
        yield _threshold_advice("given_sigma_px", _make_interval(ball.given), policy)


def _line_advice(found: LineEstimate | None, policy: Policy) -> Iterator[ThresholdAdvice]:
    if found is not None:
        for name, item in (("line_sigma_px", found.sigma), ("line_share", found.share)):
            ends = item.value, item.low, item.high
            yield _threshold_advice(f"{CALIBRATION}.{name}", ends, policy)


def _make_interval(sigma: SigmaEstimate) -> tuple[float, float, float]:
    return sigma.value, sigma.low, sigma.high


def _threshold_advice(
    name: str, found: tuple[float, float, float], policy: Policy
) -> ThresholdAdvice:
    """Advice on a threshold from an estimate and the ends of its interval."""
    threshold = next(item for item in THRESHOLDS if item.name == name)
    least, most = threshold.minimum or 0.0, threshold.maximum or np.inf
    estimate = round(float(np.clip(found[0], least, most)), DECIMALS)
    low, high = round(found[1], DECIMALS), round(found[2], DECIMALS)
    present = threshold.value(policy)
    return ThresholdAdvice(name, threshold.label, threshold.unit, present, estimate, low, high)


def _describe_notices(advice: Sequence[ThresholdAdvice], policy: Policy) -> Iterator[str]:
    if not advice:
        yield (
            "Too few views agree on a ball to estimate the noise of its annotation: the sigma of the "
            "policy is used."
        )
    if policy.noise == ESTIMATED:
        moved = any(item.differs_from_present for item in advice)
        yield ESTIMATED_WORDS + (" The next solve uses what they show now." if moved else "")
        return
    if policy.name in POLICIES:
        yield ASSUMED_WORDS
    loose = [item for item in advice if item.present is None]
    if loose:
        known = " and ".join(f"{item.estimate:g}{item.short_unit}" for item in loose)
        yield (
            "The policy estimates the noise of lines per image. All images together estimate it "
            f"better: sigma and shared part are {known}."
        )
    for item in advice:
        if item.present is not None and not item.agrees:
            word = "small" if item.present < item.low else "large"
            yield (
                f"{item.label}: the policy has {item.present:g}{item.short_unit}, this dataset shows "
                f"{item.estimate:g}{item.short_unit} ({item.low:g} to {item.high:g}). "
                "Uncertainties are too "
                f"{word} until the policy uses this value."
            )


SIZE = 64
"""Datasets whose last answer is kept; the one that was not asked for the longest goes first."""


class NoiseCache:
    """The last answer for each dataset, computed anew when log, solutions or policy differ."""

    def __init__(self, store: Store):
        self._store = store
        self._lock = Lock()
        self._kept: OrderedDict[int, tuple[tuple[int, int, str, str], NoiseReport]] = OrderedDict()

    def read(self, dataset: str | int) -> NoiseReport:
        """``estimate_dataset_noise`` of the present state.

        Raises:
            NotFoundError: There is no such dataset.
        """
        # The mark is older than what is read: at worst a new answer is computed once too often.
        with self._store.read() as session:
            entry, solution = find_newest_entry_id(session), find_newest_solution_id(session)
        state = read_policy(self._store, dataset)
        mark = entry, solution, state.policy.hash, state.dataset
        with self._lock:
            kept = self._kept.get(state.dataset_id)
            if kept is not None and kept[0] == mark:
                self._kept.move_to_end(state.dataset_id)
                return kept[1]
        noise = estimate_dataset_noise(self._store, state.dataset_id)
        with self._lock:
            self._kept[state.dataset_id] = mark, noise
            self._kept.move_to_end(state.dataset_id)
            if len(self._kept) > SIZE:
                self._kept.popitem(last=False)
        return noise
