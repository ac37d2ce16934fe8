"""The noise of a dataset: estimated from its own residuals, and put into its policy on request."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from app.errors import DegenerateGeometryError, InputError
from app.review.editing.state import GroupState, read_states
from app.review.policies.policy import PolicyState, change_policy, read_policy
from app.review.policies.text import CUSTOM, policy_with
from app.soccer.policy import POLICIES, THRESHOLDS, Policy
from app.solving.ball_noise import BallNoise, Miss, Sigma, estimate_ball_noise, misses_of
from app.solving.resect import REFERENCE_DIAGONAL, view_line_noise
from app.solving.triangulate import sights_of
from app.store.session import Store
from app.store.solutions import present_solutions

MAX_GROUPS = 600
"""Groups that an estimate looks at, spread over the dataset: more say hardly more."""
CHUNK = 100
DECIMALS = 2


@dataclass(frozen=True)
class LineNoiseSummary:
    """Noise of the clicks on field lines; each image has its own, these are the medians.

    Attributes:
        sigma_px: Distance from the line, pixels at 960 x 540; ``low`` and ``high`` hold the
            middle half of the images.
        share: Of its variance, what the points of a marking have in common.
        views: Images that were looked at.
    """

    sigma_px: float
    low: float
    high: float
    share: float
    views: int


@dataclass(frozen=True)
class Advice:
    """A threshold of the policy, what it is, and what the dataset says of it."""

    name: str
    label: str
    unit: str
    present: float
    estimate: float
    low: float
    high: float

    @property
    def agrees(self) -> bool:
        """Whether the interval holds the present value."""
        return self.low <= self.present <= self.high

    @property
    def short_unit(self) -> str:
        """As it follows a number in a sentence: a share has none."""
        return " px" if self.unit.startswith("px") else ""


@dataclass(frozen=True)
class Noise:
    """What the residuals of a dataset say about its noise.

    Attributes:
        groups: Groups that were looked at, of ``solved`` ones.
        advice: Thresholds of the policy that the dataset says something about.
        notices: Sentences for people: what disagrees, and why nothing is known.
    """

    dataset_id: int
    dataset: str
    groups: int
    solved: int
    ball: BallNoise
    lines: LineNoiseSummary | None
    advice: tuple[Advice, ...]
    notices: tuple[str, ...]

    @property
    def values(self) -> dict[str, float]:
        """The thresholds that would make the policy agree; nothing where it does already."""
        if all(item.agrees for item in self.advice):
            return {}
        return {item.name: item.estimate for item in self.advice}


def read_noise(store: Store, dataset: str | int) -> Noise:
    """The noise that the present solutions of a dataset show; changes nothing.

    Raises:
        NotFoundError: There is no such dataset.
    """
    state = read_policy(store, dataset)
    misses: list[Miss] = []
    lines: dict[str, tuple[float, float]] = {}
    ids = _solved(store, state.dataset_id)
    chosen = ids[:: max(-(-len(ids) // MAX_GROUPS), 1)]
    for group in _groups(store, chosen):
        misses += _misses(group)
        lines.update(_lines(group))
    ball = estimate_ball_noise(misses, state.policy)
    advice = tuple(_advice(ball, state.policy))
    return Noise(
        dataset_id=state.dataset_id,
        dataset=state.dataset,
        groups=len(chosen),
        solved=len(ids),
        ball=ball,
        lines=_summary(list(lines.values())),
        advice=advice,
        notices=tuple(_notices(advice)),
    )


def apply_noise(store: Store, noise: Noise, *, actor: str) -> PolicyState:
    """Judge the dataset by its policy with the noise that was estimated.

    Raises:
        InputError: The dataset says nothing about its noise, or nothing new.
    """
    if not noise.values:
        raise InputError(f'the noise in the policy of "{noise.dataset}" need not change')
    state = read_policy(store, noise.dataset_id)
    name = CUSTOM if state.policy.name in POLICIES else state.policy.name
    policy = policy_with(state.policy, noise.values, name=name)
    return change_policy(store, noise.dataset_id, policy, if_match=state.etag, actor=actor)


def _solved(store: Store, dataset_id: int) -> list[int]:
    """Ids of the groups that have a solution, in the dataset's order."""
    with store.read() as session:
        return [row[0] for row in present_solutions(session, dataset_id) if row[2] is not None]


def _groups(store: Store, chosen: Sequence[int]) -> Iterator[GroupState]:
    for start in range(0, len(chosen), CHUNK):
        with store.read() as session:
            states = read_states(session, chosen[start : start + CHUNK])
        yield from states


def _misses(state: GroupState) -> tuple[Miss, ...]:
    solution = state.solution
    if solution is None or solution.ball is None:
        return ()
    calibrations = [view.calibration for view in solution.views]
    return misses_of(solution.ball, sights_of(state.group.views, calibrations))


def _lines(state: GroupState) -> Iterator[tuple[str, tuple[float, float]]]:
    """Sigma (pixels at 960 x 540) and shared part of each calibration by its key."""
    if state.solution is None:
        return
    for view, solved in zip(state.group.views, state.solution.views, strict=True):
        calibration, size = solved.calibration, view.size
        if calibration.source != "given" and calibration.covariance is not None:
            left_out = {suspect.marking for suspect in calibration.suspects}
            lines = {k: at for k, at in view.station.lines.items() if k not in left_out}
            try:
                noise = view_line_noise(
                    calibration, lines, state.group.pitch, size, state.policy.calibration
                )
            except (DegenerateGeometryError, np.linalg.LinAlgError):
                # Lines that leave the camera open say nothing of their noise.
                continue
            unit = size.diagonal / REFERENCE_DIAGONAL
            yield solved.calibration_key, (float(np.sqrt(noise.variance)) / unit, noise.share)


def _summary(found: Sequence[tuple[float, float]]) -> LineNoiseSummary | None:
    if not found:
        return None
    sigmas, shares = np.transpose(found)
    low, middle, high = np.percentile(sigmas, [25, 50, 75]).tolist()
    return LineNoiseSummary(middle, low, high, float(np.median(shares)), len(sigmas))


def _advice(ball: BallNoise, policy: Policy) -> Iterator[Advice]:
    if ball.click is not None:
        yield _advised("click_sigma_px", _ends(ball.click), policy)
    if ball.share is not None and ball.share_interval is not None:
        yield _advised("box_sigma_share", (ball.share, *ball.share_interval), policy)
    if ball.given is not None:
        yield _advised("given_sigma_px", _ends(ball.given), policy)


def _ends(sigma: Sigma) -> tuple[float, float, float]:
    return sigma.value, sigma.low, sigma.high


def _advised(name: str, found: tuple[float, float, float], policy: Policy) -> Advice:
    """Advice on a threshold from an estimate and the ends of its interval."""
    threshold = next(item for item in THRESHOLDS if item.name == name)
    least, most = threshold.minimum or 0.0, threshold.maximum or np.inf
    estimate = round(float(np.clip(found[0], least, most)), DECIMALS)
    low, high = round(found[1], DECIMALS), round(found[2], DECIMALS)
    present = float(threshold.value(policy))
    return Advice(name, threshold.label, threshold.unit, present, estimate, low, high)


def _notices(advice: Sequence[Advice]) -> Iterator[str]:
    if not advice:
        yield (
            "Too few views that agree about a ball to tell how noisy its clicks are: the policy's "
            "sigma is used as it is."
        )
    for item in advice:
        if not item.agrees:
            word = "small" if item.present < item.low else "large"
            yield (
                f"{item.label}: the policy says {item.present:g}{item.short_unit}, this dataset "
                f"{item.estimate:g}{item.short_unit} ({item.low:g} to {item.high:g}). "
                "Uncertainties are too "
                f"{word} until the policy says so too."
            )
