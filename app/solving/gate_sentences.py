"""Gates: what a group must pass to enter the dataset, in order and in words; ``judgement`` compares.

The first three drop views; the others judge the group from the views that are left.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import floor, isfinite, isnan, log10

from app.soccer.policy import Policy
from app.soccer.solution import (
    GATES,
    Ball3D,
    Calibration,
    ChiSquare,
    Gate,
    TriangulatedPair,
    compute_margin,
)
from app.solving.chi_square import LOW_P_VALUE
from app.solving.judgement import MIN_VIEWS, Judgement
from app.wording import format_degrees, format_metres, format_percent, format_pixels, plural

UNLIKELY_P_VALUE = 0.05
"""Below: consistent views have residuals as large as these in fewer than one of twenty groups."""


@dataclass(frozen=True)
class JudgedView:
    """What the gates know of a view.

    Attributes:
        key: Of the view.
        letter: What people call it.
        calibration: Its calibration.
        jac: At the policy's gamma; None without lines to measure it.
        tau_px: Largest reprojection error of a valid pair in this view, pixels.
        has_ball: Whether it shows the one ball.
        failed: First gate that dropped it, or None.
        no_ball: Why it has none that counts, with a place for letters.
    """

    key: str
    letter: str
    calibration: Calibration
    jac: float | None
    tau_px: float
    has_ball: bool
    failed: str | None
    no_ball: str = "none in {}"


@dataclass(frozen=True)
class _JudgedGroup:
    """What the sentences are written from.

    Attributes:
        views: The included ones.
        left_out: Letters of the views that a person left out.
        failed: Names of the gates that the group fails.
    """

    views: Sequence[JudgedView]
    left_out: Sequence[str]
    failed: frozenset[str]

    @property
    def remaining_views(self) -> list[JudgedView]:
        """The views that no gate drops."""
        return [view for view in self.views if view.failed is None]

    def views_failing(self, gate: str) -> list[JudgedView]:
        """The views that a gate drops."""
        return [view for view in self.views if view.failed == gate]


def describe_gates(
    views: Sequence[JudgedView],
    left_out: Sequence[str],
    pairs: Sequence[TriangulatedPair],
    ball: Ball3D | None,
    judgement: Judgement,
    policy: Policy,
    chi_square: ChiSquare | None = None,
) -> tuple[Gate, ...]:
    """All gates in order, those that the policy does not ask for as not active.

    Agreement is there only where it is asked for: solutions of other policies stay as they were.

    Args:
        views: The included views.
        left_out: Letters of the views that a person left out.
        pairs: Their pairs.
        ball: The triangulated ball, or None.
        judgement: Of the one group.
        policy: The thresholds.
        chi_square: The test of the ball's residuals, or None.
    """
    failed = zip(GATES, judgement.failed[:, 0].tolist(), strict=True)
    group = _JudgedGroup(views, left_out, frozenset(name for name, fails in failed if fails))
    return (
        _make_calibratable_gate(group),
        _make_jac_gate(group, policy),
        *_make_agreement_gates(group, policy),
        _make_two_views_gate(group),
        _make_ball_gate(group),
        _make_baseline_gate(group, pairs, float(judgement.baseline[0]), policy),
        _make_tau_gate(group, pairs, policy),
        _make_parallax_gate(group, ball, policy),
        _make_sigma_gate(group, ball, policy),
        _make_chi_square_gate(group, chi_square, policy),
    )


def _make_calibratable_gate(group: _JudgedGroup) -> Gate:
    fallen, views = group.views_failing("calibratable"), group.views
    count = len(views) - len(fallen)
    blamed = "calibratable" in group.failed
    sentence = f"in {count} of {len(views)} views"
    if guessed := [view for view in views if _has_undetermined_parameters(view.calibration)]:
        sentence += f", {_join_letters(guessed)} uncertain"
    if blamed:
        sentence = f"{fallen[0].letter} has no camera: {fallen[0].calibration.reason}"
    return _make_gate(
        "calibratable",
        not blamed,
        count,
        min(MIN_VIEWS, len(views)),
        sentence,
        view=fallen[0].key if blamed else None,
    )


def _has_undetermined_parameters(calibration: Calibration) -> bool:
    """Whether the lines leave open a part of the camera that was found."""
    return calibration.camera is not None and bool(calibration.unobservable)


def _make_jac_gate(group: _JudgedGroup, policy: Policy) -> Gate:
    measured = [(view.jac, view) for view in group.views if view.jac is not None]
    if not measured:
        given = any(view.calibration.source == "given" for view in group.views)
        sentence = "not measured, the cameras were given" if given else "nothing to measure"
        return Gate("jac", True, None, policy.min_jac, None, sentence)
    return _make_worst_view_gate("jac", group, measured, policy.min_jac)


def _make_agreement_gates(group: _JudgedGroup, policy: Policy) -> Iterator[Gate]:
    threshold = policy.min_agreement
    if threshold is None:
        return
    found = [(view.calibration.agreement, view) for view in group.views]
    measured = [(value, view) for value, view in found if value is not None]
    if not measured:
        yield Gate("agreement", True, None, threshold, None, "no paint was read")
        return
    yield _make_worst_view_gate("agreement", group, measured, threshold)


def _make_worst_view_gate(
    name: str, group: _JudgedGroup, measured: Sequence[tuple[float, JudgedView]], threshold: float
) -> Gate:
    """A gate of views, by the smallest number of those that it judges."""
    blamed = name in group.failed
    fallen = [item for item in measured if item[1].failed == name]
    left = [item for item in measured if item[1].failed != name]
    if not blamed and not left:
        # The views that are left have nothing to measure: no tick stands beside those that fell.
        value, view = min(measured, key=lambda item: item[0])
        sentence = f"{view.letter}: {_format_beside_limit(value, threshold)}, not used"
        if len(measured) < len(group.views):
            sentence += "; the rest not measured"
        return Gate(name, True, None, threshold, None, sentence)
    shown = fallen if blamed else [item for item in left if item[1].failed is None] or left
    value, view = min(shown, key=lambda item: item[0])
    sentence = f"{view.letter}: {_format_beside_limit(value, threshold)}"
    if value == threshold and view.failed == name:
        sentence += f", must be above {threshold:.2f}"
    elif len(shown) > 1:
        sentence += " (lowest)"
    if fallen and not blamed:
        sentence += f"; {_join_letters([view for _, view in fallen])} too low, not used"
    key = view.key if blamed else None
    return _make_gate(name, not blamed, value, threshold, sentence, view=key)


_FALLEN_AT = {
    "calibratable": "no camera",
    "jac": "lines do not fit",
    "agreement": "paint contradicts the camera",
}
"""Why a view does not count."""


def _format_beside_limit(value: float, limit: float) -> str:
    """A value in as many digits as it takes to tell it from its limit."""
    same = value != limit and f"{value:.2f}" == f"{limit:.2f}"
    return f"{value:.4f}" if same else f"{value:.2f}"


def _make_two_views_gate(group: _JudgedGroup) -> Gate:
    count, passed = len(group.remaining_views), "two_views" not in group.failed
    sentence = f"{count} of {len(group.views) + len(group.left_out)}"
    if not passed:
        why = _describe_failed_views(group.views)
        if group.left_out:
            why.append(f"{', '.join(group.left_out)} left out by a person")
        sentence = ", ".join([sentence, *why])
    return _make_gate("two_views", passed, count, MIN_VIEWS, sentence)


def _make_ball_gate(group: _JudgedGroup) -> Gate:
    without = [view for view in group.remaining_views if not view.has_ball]
    count = len(group.remaining_views) - len(without)
    passed = "ball" not in group.failed
    sentence = f"in {plural(count, 'view')}"
    for why in dict.fromkeys(view.no_ball for view in without):
        alike = _join_letters([view for view in without if view.no_ball == why])
        sentence += f", {why.format(alike)}"
    if not passed:
        idle = _describe_failed_views([view for view in group.views if view.has_ball])
        sentence = ", ".join([sentence, *idle])
    view = without[0].key if without and not passed else None
    return _make_gate("ball", passed, count, MIN_VIEWS, sentence, view=view)


def _describe_failed_views(views: Sequence[JudgedView]) -> list[str]:
    """Which views do not count, and why: one text for each reason."""
    reasons = {
        name: [view for view in views if view.failed == name]
        for name in dict.fromkeys(view.failed for view in views if view.failed is not None)
    }
    return [
        f"{_join_letters(fallen)} not counted ({_FALLEN_AT[name]})"
        for name, fallen in reasons.items()
    ]


def _make_baseline_gate(
    group: _JudgedGroup, pairs: Sequence[TriangulatedPair], widest: float, policy: Policy
) -> Gate:
    if isnan(widest):
        return _make_unjudged_gate("baseline", policy.min_baseline_m)
    passed = "baseline" not in group.failed
    letters = "–".join(view.letter for view in group.remaining_views if view.has_ball)
    sentence = f"{widest:.1f} m" if passed else f"{letters} {widest:.1f} m apart"
    named = _letters_by_view(group)
    close = [pair for pair in pairs if pair.failed == "baseline"]
    if passed and close:
        unused = ", ".join(
            f"{_format_pair_letters(pair, named)} {pair.baseline_m:.1f} m" for pair in close
        )
        sentence += f"; {unused} not used"
    return _make_gate("baseline", passed, widest, policy.min_baseline_m, sentence)


def _letters_by_view(group: _JudgedGroup) -> dict[str, str]:
    return {view.key: view.letter for view in group.views}


def _make_tau_gate(group: _JudgedGroup, pairs: Sequence[TriangulatedPair], policy: Policy) -> Gate:
    tau_px = {view.key: view.tau_px for view in group.remaining_views}
    return make_reprojection_gate(pairs, _letters_by_view(group), tau_px, policy.tau_percent)


def make_reprojection_gate(
    pairs: Sequence[TriangulatedPair],
    letters: Mapping[str, str],
    tau_px: Mapping[str, float],
    tau_percent: float,
) -> Gate:
    """The gate of the best pair: its error that is larger in units of tau.

    Args:
        pairs: Of the group.
        letters: What people call the views, by key.
        tau_px: Largest reprojection error of a valid pair in each view, pixels, by key.
        tau_percent: The same, of the image diagonal of each view.
    """
    judged = [
        (find_larger_error_in_tau(pair, tau_px), pair)
        for pair in pairs
        if pair.failed in (None, "reprojection")
    ]
    if not judged:
        return _make_unjudged_gate("reprojection", None)
    (_, error, tau), best = min(judged, key=lambda item: (not item[1].valid, item[0][0]))
    sentence = f"{_format_pair_letters(best, letters)} {format_pixels(error)}, {_format_percent_of_limit(error / tau, tau_percent)}"
    if len(judged) > 1:
        sentence += " (best pair)"
    margin = compute_margin(error, tau, at_most=True)
    if not best.valid and error <= tau:
        # Its pixels are near enough, and there is no ball: no share of tau says how far it is off.
        sentence, margin = (
            f"the rays of {_format_pair_letters(best, letters)} meet behind a camera",
            None,
        )
    left_out = [pair for _, pair in judged if not pair.valid]
    if best.valid and left_out:
        sentence += (
            f"; {', '.join(_format_pair_letters(pair, letters) for pair in left_out)} not used"
        )
    return Gate("reprojection", best.valid, error, tau, margin, sentence)


def _format_percent_of_limit(share: float, limit: float) -> str:
    """A share of a limit as per cent, in as many digits as it takes to tell it from the limit.

    Example:
        >>> _format_percent_of_limit(0.14, 1.0), _format_percent_of_limit(1.0002, 1.0)
        ('0.14 %', '1.0002 %')
    """
    value = share * limit
    return f"{_format_beside_limit(value, limit) if round(value, 2) == round(limit, 2) else format_percent(value)} %"


def find_larger_error_in_tau(
    pair: TriangulatedPair, tau_px: Mapping[str, float]
) -> tuple[float, float, float]:
    """Of the view of a pair that is farther off: error in units of tau, error, tau (pixels).

    Args:
        pair: A pair of views.
        tau_px: Largest error of a valid pair by view, pixels.
    """
    taus = tau_px[pair.a], tau_px[pair.b]
    errors = ((error / tau, error, tau) for error, tau in zip(pair.errors_px, taus, strict=True))
    return max(errors, key=lambda item: item[0])


def _format_pair_letters(pair: TriangulatedPair, letters: Mapping[str, str]) -> str:
    return f"{letters[pair.a]}–{letters[pair.b]}"


def _make_parallax_gate(group: _JudgedGroup, ball: Ball3D | None, policy: Policy) -> Gate:
    threshold, active = policy.min_parallax_degrees, policy.min_parallax_degrees is not None
    if ball is None:
        return _make_unjudged_gate("parallax", threshold, active=active)
    value, passed = ball.parallax_degrees, "parallax" not in group.failed
    return _make_gate("parallax", passed, value, threshold, format_degrees(value), active=active)


def _make_sigma_gate(group: _JudgedGroup, ball: Ball3D | None, policy: Policy) -> Gate:
    threshold, active = policy.max_sigma_m, policy.max_sigma_m is not None
    if ball is None:
        return _make_unjudged_gate("sigma", threshold, active=active)
    value, passed = ball.sigma_m, "sigma" not in group.failed
    margin = compute_margin(value, threshold, at_most=True)
    sentence = format_metres(value) if isfinite(value) else "not known"
    left_open = [
        item for item in group.views if item.key in ball.views and item.calibration.is_left_open
    ]
    if left_open:
        sentence = describe_open_cameras([item.letter for item in left_open])
    view = left_open[0].key if left_open and not passed else None
    return Gate("sigma", passed, value, threshold, margin, sentence, view, active)


def describe_open_cameras(letters: Sequence[str]) -> str:
    """What makes the uncertainty of a ball unknown.

    Example:
        >>> describe_open_cameras(["B"])
        'the lines of view B leave its camera open'
        >>> describe_open_cameras(["A", "B", "C"])
        'the lines of views A, B and C leave their cameras open'
    """
    if len(letters) == 1:
        return f"the lines of view {letters[0]} leave its camera open"
    return f"the lines of views {join_with_and(letters)} leave their cameras open"


def join_with_and(letters: Sequence[str]) -> str:
    """Letters of two or more views in a sentence.

    Example:
        >>> join_with_and(["A", "B"]), join_with_and(["A", "B", "C"])
        ('A and B', 'A, B and C')
    """
    return f"{', '.join(letters[:-1])} and {letters[-1]}"


def _make_chi_square_gate(group: _JudgedGroup, found: ChiSquare | None, policy: Policy) -> Gate:
    threshold, active = policy.min_p_value, policy.min_p_value is not None
    passed = "chi_square" not in group.failed
    if found is None and not (active and passed):
        return _make_unjudged_gate("chi_square", threshold, active=active)
    if found is None or (active and not _has_known_cameras(group, found, policy)):
        sentence = "not judged: a camera has no known uncertainty"
        return Gate("chi_square", passed, None, threshold, None, sentence, active=active)
    sentence = f"{describe_consistency(found.p_value)} ({_format_p_value(found.p_value)})"
    return _make_gate("chi_square", passed, found.p_value, threshold, sentence, active=active)


def _has_known_cameras(group: _JudgedGroup, found: ChiSquare, policy: Policy) -> bool:
    cameras = [view.calibration for view in group.views if view.key in found.views]
    return all(
        item.has_known_covariance or (item.is_given_without_uncertainty and policy.given_sigma_px)
        for item in cameras
    )


def describe_consistency(p_value: float) -> str:
    """How well the residuals agree with their uncertainty, in a word.

    Args:
        p_value: Of their chi-square test.

    Example:
        >>> describe_consistency(0.72), describe_consistency(0.01), describe_consistency(0.0004)
        ('normal', 'unlikely', 'contradictory')
    """
    if p_value < LOW_P_VALUE:
        return "contradictory"
    return "unlikely" if p_value < UNLIKELY_P_VALUE else "normal"


def _format_p_value(p_value: float) -> str:
    """A p-value in two digits.

    Example:
        >>> _format_p_value(0.72), _format_p_value(0.00083), _format_p_value(1e-12)
        ('p = 0.72', 'p = 0.00083', 'p < 0.000001')
    """
    if p_value < 1e-6:
        return "p < 0.000001"
    digits = max(2, 1 - floor(log10(p_value)))
    return f"p = {p_value:.{digits}f}"


def describe_odds(p_value: float) -> str:
    """How often something happens, for people.

    Example:
        >>> describe_odds(0.31), describe_odds(0.0004), describe_odds(1e-12)
        ('31 % of groups', '1 of 2,500 groups', 'fewer than 1 of a million groups')
    """
    if p_value >= 0.01:
        return f"{p_value:.0%} of groups".replace("%", " %")
    if p_value < 1e-6:
        return "fewer than 1 of a million groups"
    return f"1 of {float(f'{1 / p_value:.2g}'):,.0f} groups"


def _make_gate(
    name: str,
    passed: bool,
    value: float,
    threshold: float | None,
    sentence: str,
    *,
    view: str | None = None,
    active: bool = True,
) -> Gate:
    margin = compute_margin(value, threshold)
    return Gate(name, passed, float(value), threshold, margin, sentence, view, active)


def _make_unjudged_gate(name: str, threshold: float | None, *, active: bool = True) -> Gate:
    return Gate(name, False, None, threshold, None, "not judged", active=active)


def _join_letters(views: Sequence[JudgedView]) -> str:
    return ", ".join(view.letter for view in views)
