"""Gates: what a group must pass to enter the dataset, in order.

The first two drop views; the others judge the group from the views that are left.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from app.soccer.policy import Policy
from app.soccer.solution import Ball3D, Calibration, Gate, Pair, margin_of

MIN_VIEWS = 2


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
    """

    key: str
    letter: str
    calibration: Calibration
    jac: float | None
    tau_px: float
    has_ball: bool
    failed: str | None


def view_failure(calibration: Calibration, jac: float | None, policy: Policy) -> str | None:
    """The first gate that drops a view, or None."""
    if calibration.camera is None:
        return "calibratable"
    if jac is not None and not jac > policy.min_jac:
        return "jac"
    return None


def judge(
    views: Sequence[JudgedView],
    left_out: Sequence[str],
    pairs: Sequence[Pair],
    ball: Ball3D | None,
    policy: Policy,
) -> tuple[Gate, ...]:
    """All gates in order, those that the policy does not ask for as not active.

    Args:
        views: The included views.
        left_out: Letters of the views that a person left out.
        pairs: Their pairs.
        ball: The triangulated ball, or None.
        policy: The thresholds.
    """
    left = [view for view in views if view.failed is None]
    short = len(left) < MIN_VIEWS
    return (
        _calibratable(views, short),
        _jac(views, short, policy),
        _two_views(views, left, left_out),
        _ball(views, left),
        _baseline(left, pairs, policy),
        _reprojection(left, pairs),
        _parallax(ball, policy),
        _sigma(ball, policy),
    )


def _calibratable(views: Sequence[JudgedView], short: bool) -> Gate:
    fallen = [view for view in views if view.failed == "calibratable"]
    count = len(views) - len(fallen)
    blamed = short and bool(fallen) and count < MIN_VIEWS
    sentence = f"in {count} of {len(views)} views"
    if blamed:
        sentence = f"{fallen[0].letter} has no camera: {fallen[0].calibration.reason}"
    return _gate(
        "calibratable",
        not blamed,
        count,
        min(MIN_VIEWS, len(views)),
        sentence,
        view=fallen[0].key if blamed else None,
    )


def _jac(views: Sequence[JudgedView], short: bool, policy: Policy) -> Gate:
    measured = [(view.jac, view) for view in views if view.jac is not None]
    fallen = [(jac, view) for jac, view in measured if view.failed == "jac"]
    calibrated = sum(view.failed != "calibratable" for view in views)
    blamed = short and bool(fallen) and calibrated >= MIN_VIEWS
    if not measured:
        given = any(view.calibration.source == "given" for view in views)
        sentence = "not measured, the cameras were given" if given else "nothing to measure"
        return Gate("jac", True, None, policy.min_jac, None, sentence)
    shown = fallen if blamed else [item for item in measured if item[1].failed is None] or measured
    jac, view = min(shown, key=lambda item: item[0])
    sentence = f"{'worst ' if len(shown) > 1 else ''}{_beside(jac, policy.min_jac)} · {view.letter}"
    if fallen and not blamed:
        sentence += f"; {_letters([view for _, view in fallen])} below, not used"
    key = view.key if blamed else None
    return _gate("jac", not blamed, jac, policy.min_jac, sentence, view=key)


_FALLEN_AT = {"calibratable": "no camera", "jac": "lines do not fit"}
"""Why a view does not count."""


def _beside(value: float, limit: float) -> str:
    """A value in as many digits as it takes to tell it from its limit; the limit itself is said."""
    if value == limit:
        return f"exactly {value:.2f}"
    return f"{value:.2f}" if f"{value:.2f}" != f"{limit:.2f}" else f"{value:.4f}"


def _two_views(
    views: Sequence[JudgedView], left: Sequence[JudgedView], left_out: Sequence[str]
) -> Gate:
    sentence = f"{len(left)} of {len(views) + len(left_out)}"
    if len(left) < MIN_VIEWS:
        why = [*_fallen(views)]
        if left_out:
            why.append(f"{', '.join(left_out)} left out by a person")
        sentence = ", ".join([sentence, *why])
    return _gate("two_views", len(left) >= MIN_VIEWS, len(left), MIN_VIEWS, sentence)


def _ball(views: Sequence[JudgedView], left: Sequence[JudgedView]) -> Gate:
    without = [view for view in left if not view.has_ball]
    count = len(left) - len(without)
    passed = count >= MIN_VIEWS
    sentence = f"in {count} {'view' if count == 1 else 'views'}"
    if without:
        sentence += f", none in {_letters(without)}"
    if not passed:
        idle = _fallen([view for view in views if view.has_ball])
        sentence = ", ".join([sentence, *idle])
    view = without[0].key if without and not passed else None
    return _gate("ball", passed, count, MIN_VIEWS, sentence, view=view)


def _fallen(views: Sequence[JudgedView]) -> list[str]:
    """Which views do not count, and why: one text for each reason."""
    reasons = {
        name: [view for view in views if view.failed == name]
        for name in dict.fromkeys(view.failed for view in views if view.failed is not None)
    }
    return [
        f"{_letters(fallen)} not counted ({_FALLEN_AT.get(name, name)})"
        for name, fallen in reasons.items()
    ]


def _baseline(left: Sequence[JudgedView], pairs: Sequence[Pair], policy: Policy) -> Gate:
    names = {view.key for view in left}
    apart = [pair.baseline_m for pair in pairs if pair.a in names and pair.b in names]
    if not apart and sum(view.has_ball for view in left) >= MIN_VIEWS:
        # One camera twice: there is nothing to triangulate.
        apart = [0.0]
    if not apart:
        return _unjudged("baseline", policy.min_baseline_m)
    widest = max(apart)
    passed = widest >= policy.min_baseline_m
    letters = "–".join(view.letter for view in left if view.has_ball)
    return _gate(
        "baseline",
        passed,
        widest,
        policy.min_baseline_m,
        f"{widest:.1f} m" if passed else f"{letters} {widest:.1f} m apart",
    )


def _reprojection(left: Sequence[JudgedView], pairs: Sequence[Pair]) -> Gate:
    """Judged by the best pair: its error that is larger in units of tau."""
    views = {view.key: view for view in left}
    judged = [
        (max(_shares(pair, views), key=lambda share: share[0]), pair)
        for pair in pairs
        if pair.failed in (None, "reprojection") and pair.a in views and pair.b in views
    ]
    if not judged:
        return _unjudged("reprojection", None)
    (_, error, tau), best = min(judged, key=lambda item: (not item[1].valid, item[0][0]))
    sentence = f"{_name(best, views)} {error:.1f} px"
    left_out = [pair for _, pair in judged if not pair.valid]
    if best.valid and left_out:
        sentence += f"; {', '.join(_name(pair, views) for pair in left_out)} left out"
    margin = margin_of(error, tau, at_most=True)
    return Gate("reprojection", best.valid, error, tau, margin, sentence)


def _shares(
    pair: Pair, views: Mapping[str, JudgedView]
) -> tuple[tuple[float, float, float], tuple[float, float, float]]:
    """For both views: error in units of tau, error, tau."""
    first, second = views[pair.a].tau_px, views[pair.b].tau_px
    return (
        (pair.errors_px[0] / first, pair.errors_px[0], first),
        (pair.errors_px[1] / second, pair.errors_px[1], second),
    )


def _name(pair: Pair, views: Mapping[str, JudgedView]) -> str:
    return f"{views[pair.a].letter}–{views[pair.b].letter}"


def _parallax(ball: Ball3D | None, policy: Policy) -> Gate:
    threshold, active = policy.min_parallax_degrees, policy.min_parallax_degrees is not None
    if ball is None:
        return _unjudged("parallax", threshold, active=active)
    value = ball.parallax_degrees
    passed = threshold is None or value >= threshold
    return _gate("parallax", passed, value, threshold, f"{value:.1f}°", active=active)


def _sigma(ball: Ball3D | None, policy: Policy) -> Gate:
    threshold, active = policy.max_sigma_m, policy.max_sigma_m is not None
    if ball is None:
        return _unjudged("sigma", threshold, active=active)
    value = ball.sigma_m
    margin = margin_of(value, threshold, at_most=True)
    passed = threshold is None or threshold - value >= 0
    return Gate("sigma", passed, value, threshold, margin, f"{value:.2f} m", active=active)


def _gate(
    name: str,
    passed: bool,
    value: float,
    threshold: float | None,
    sentence: str,
    *,
    view: str | None = None,
    active: bool = True,
) -> Gate:
    margin = margin_of(value, threshold)
    return Gate(name, passed, float(value), threshold, margin, sentence, view, active)


def _unjudged(name: str, threshold: float | None, *, active: bool = True) -> Gate:
    return Gate(name, False, None, threshold, None, "not judged", active=active)


def _letters(views: Sequence[JudgedView]) -> str:
    return ", ".join(view.letter for view in views)
