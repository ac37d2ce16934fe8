"""Solutions as JSON, compiled from their type hints, and the summary by which groups are listed.

Solutions are rebuilt whenever the solver changes, so their JSON follows the dataclasses; what
people annotated has explicit codecs of its own (``soccer.codec``)."""

from __future__ import annotations

import dataclasses
import json
import math
import types
import typing
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache
from typing import Any, TypeVar

import msgspec

from app.db.json_columns import translate_shape_errors_to_damage
from app.geometry.camera import Camera
from app.json_text import prepare_msgspec_type
from app.soccer.codec import camera_from_json, camera_to_json
from app.soccer.frames import ImagePoint, height_above_grass
from app.soccer.group import Group
from app.soccer.solution import BallFit, Calibration, Gate, Solution, ViewSolution

T = TypeVar("T")
Codec = tuple[Callable[[Any], Any], Callable[[Any], Any]]


COUNTED = frozenset({"calibratable", "two_views", "ball"})
"""Gates that count views."""


def to_json(value: Any) -> Any:
    """A dataclass of numbers, texts, tuples and other dataclasses as JSON values.

    A field that came later (``metadata``) stands there only where it says something, so that what
    was computed before it came is the same bytes.
    """
    return _get_codec(type(value))[0](value)


def from_json(kind: type[T], value: Any) -> T:
    """Back from ``to_json``; fields that the JSON does not have keep their default.

    Raises:
        DamagedError: It is not what ``to_json`` makes.
    """
    with translate_shape_errors_to_damage():
        result: T = _get_codec(kind)[1](value)
    return result


def solution_json_text(value: Any) -> str:
    """JSON text of a value of ``to_json``; a number that is not finite becomes its name."""
    try:
        return json.dumps(value, separators=(",", ":"), allow_nan=False)
    except ValueError:
        return json.dumps(
            _replace_non_finite_by_name(value), separators=(",", ":"), allow_nan=False
        )


def _replace_non_finite_by_name(value: Any) -> Any:
    if isinstance(value, float) and not math.isfinite(value):
        return str(value)
    if isinstance(value, dict):
        return {key: _replace_non_finite_by_name(item) for key, item in value.items()}
    return (
        [_replace_non_finite_by_name(item) for item in value]
        if isinstance(value, list | tuple)
        else value
    )


def _identity(value: Any) -> Any:
    return value


def _get_codec(hint: Any) -> Codec:
    return _make_codec(hint)


@cache
def _make_codec(hint: Any) -> Codec:
    if hint is float:
        # ``float`` also reads the names of numbers that are not finite.
        return _identity, float
    if hint in (int, str, bool, type(None)):
        return _identity, _identity
    if hint is ImagePoint:
        return list, ImagePoint._make
    if hint is Camera:
        return camera_to_json, camera_from_json
    if dataclasses.is_dataclass(hint):
        return _dataclass_codec(hint)
    origin, arguments = typing.get_origin(hint), typing.get_args(hint)
    if origin in (types.UnionType, typing.Union):
        return _optional_codec(arguments)
    if origin is tuple:
        return _tuple_codec(arguments)
    if origin is typing.Literal:
        return _identity, _identity
    raise TypeError(f"no codec for {hint}")


def _dataclass_codec(kind: Any) -> Codec:
    hints = typing.get_type_hints(kind)
    codecs = [(item.name, *_get_codec(hints[item.name])) for item in dataclasses.fields(kind)]
    later = {
        item.name: item.default for item in dataclasses.fields(kind) if "later" in item.metadata
    }

    def encode_all_fields(value: Any) -> Any:
        return {name: to(getattr(value, name)) for name, to, _ in codecs}

    def encode(value: Any) -> Any:
        written = encode_all_fields(value)
        for name, default in later.items():
            if getattr(value, name) == default:
                del written[name]
        return written

    def decode(value: Any) -> Any:
        return kind(**{name: back(value[name]) for name, _, back in codecs if name in value})

    def decode_plain(value: Any) -> Any:
        try:
            return msgspec.convert(value, kind)
        except msgspec.ValidationError:
            # The name of a number that is not finite is no number to it.
            return decode(value)

    if not _is_plain_json_type(kind):
        return encode if later else encode_all_fields, decode
    prepare_msgspec_type(kind)
    return encode if later else encode_all_fields, decode_plain


def _is_plain_json_type(hint: Any) -> bool:
    """Whether JSON holds a type as a library reads it; a camera has a codec of its own."""
    if hint is Camera:
        return False
    hints = typing.get_type_hints(hint).values() if dataclasses.is_dataclass(hint) else ()
    return all(map(_is_plain_json_type, (*hints, *typing.get_args(hint))))


def _optional_codec(arguments: tuple[Any, ...]) -> Codec:
    (inner,) = (item for item in arguments if item is not type(None))
    to, back = _get_codec(inner)
    return (
        lambda value: None if value is None else to(value),
        lambda value: None if value is None else back(value),
    )


def _tuple_codec(arguments: tuple[Any, ...]) -> Codec:
    if len(arguments) == 2 and arguments[1] is Ellipsis:
        to, back = _get_codec(arguments[0])
        if to is _identity:
            return list, lambda value: tuple(map(back, value))
        return (
            lambda value: [to(item) for item in value],
            lambda value: tuple(map(back, value)),
        )
    codecs = [_get_codec(item) for item in arguments]
    return (
        lambda value: [to(item) for (to, _), item in zip(codecs, value, strict=True)],
        lambda value: tuple(back(item) for (_, back), item in zip(codecs, value, strict=True)),
    )


@dataclass(frozen=True)
class SolutionSummary:
    """What a list shows of a solution; None where there is no such number.

    Attributes:
        margin: Of the first failing gate, or of the gate nearest to failing: a share of its
            threshold (``solution.compute_margin``), negative when it fails.
        value: The margin without its sign: how close the group is to passing, or to failing.
            Where it is small, a small mistake decides.
        min_jac: The lowest JaC of the views in use at 0.5 %.
        parallax_degrees: Of the ball, like ``sigma_m`` and ``height_m``.
        error_px: The larger reprojection error of the best pair, which the gate of that name judges;
            ``error_percent`` the same in per cent of the diagonal.
        size_ratio: Annotated over optimised diameter, the one farthest from 1.
        findings: Kinds, each once.
        distance_m: Of the ball from the camera of the first view that it comes from.
        box_px: Diameter of the ball in that view, as annotated, else (a point) as optimised;
            without a ball that of the first view that has an annotated box.
        x_m: Of the ball in the pitch frame, like ``y_m``.
        agreement: The lowest of the views in use whose paint was read.
    """

    passes: bool
    gate: str | None
    gate_view: str | None
    gate_sentence: str | None
    margin: float | None
    value: float | None
    min_jac: float | None
    error_px: float | None
    error_percent: float | None
    sigma_m: float | None
    parallax_degrees: float | None
    size_ratio: float | None
    height_m: float | None
    findings: tuple[str, ...]
    distance_m: float | None = None
    box_px: float | None = None
    x_m: float | None = None
    y_m: float | None = None
    agreement: float | None = None


def summarize_solution(group: Group, solution: Solution) -> SolutionSummary:
    """The summary of a group's solution."""
    ball = solution.ball
    error_px, error_percent = _reprojection_error(group, solution)
    return SolutionSummary(
        **_summarize_gate_columns(solution),
        min_jac=_find_smallest_jac(group, solution),
        error_px=error_px,
        error_percent=error_percent,
        sigma_m=_finite_or_none(ball.sigma_m) if ball else None,
        parallax_degrees=ball.parallax_degrees if ball else None,
        size_ratio=_worst_size_ratio(solution),
        height_m=height_above_grass(ball.point[2]) if ball else None,
        findings=tuple(dict.fromkeys(finding.kind for finding in solution.findings)),
        distance_m=_ball_distance(solution),
        box_px=_find_box_diameter(group, solution),
        x_m=ball.point[0] if ball else None,
        y_m=ball.point[1] if ball else None,
        agreement=_find_smallest_agreement(group, solution),
    )


def replace_gates_in_summary(before: SolutionSummary, solution: Solution) -> SolutionSummary:
    """The summary of a solution that is that of ``before`` but for what its gates say."""
    return replace(before, **_summarize_gate_columns(solution))


def _summarize_gate_columns(solution: Solution) -> dict[str, Any]:
    """What a summary says of gates."""
    failing = solution.first_failing
    decisive = failing or _gate_nearest_to_failing(solution.gates)
    margin = decisive.margin if decisive else None
    return {
        "passes": solution.passes,
        "gate": failing.name if failing else None,
        "gate_view": failing.view if failing else None,
        "gate_sentence": failing.sentence if failing else None,
        "margin": margin,
        "value": None if margin is None else abs(margin),
    }


def _finite_or_none(value: float | None) -> float | None:
    return value if value is not None and math.isfinite(value) else None


def _gate_nearest_to_failing(gates: tuple[Gate, ...]) -> Gate | None:
    """Of gates that pass, the one nearest to failing; two views of two are enough, not near."""
    measured = [
        gate
        for gate in gates
        if gate.active and gate.margin is not None and gate.name not in COUNTED
    ]
    return min(measured, key=lambda gate: gate.margin or 0.0, default=None)


def _find_smallest_jac(group: Group, solution: Solution) -> float | None:
    # The first of GAMMAS_PERCENT is the one that curation speaks of.
    measured = (item.jac for item in _list_calibrations_in_use(group, solution))
    return min((jac[0] for jac in measured if jac), default=None)


def _find_smallest_agreement(group: Group, solution: Solution) -> float | None:
    found = (item.agreement for item in _list_calibrations_in_use(group, solution))
    return min((value for value in found if value is not None), default=None)


def _list_calibrations_in_use(group: Group, solution: Solution) -> list[Calibration]:
    used = {view.key for view in group.views if view.included}
    return [view.calibration for view in solution.views if view.view in used]


def _reprojection_error(group: Group, solution: Solution) -> tuple[float | None, float | None]:
    """What the gate of the reprojection judges, in pixels and in per cent of its view's diagonal."""
    judged = (gate.value for gate in solution.gates if gate.name == "reprojection")
    error = next(judged, None)
    for pair in solution.pairs:
        for key, apart in zip((pair.a, pair.b), pair.errors_px, strict=True):
            view = group.view(key)
            if apart == error and view is not None:
                return error, 100.0 * apart / view.size.diagonal
    return _finite_or_none(error), None


def _ball_fits(solution: Solution) -> list[BallFit]:
    """Fits of the views that the ball comes from."""
    if solution.ball is None:
        return []
    views = (view for view in solution.views if view.view in solution.ball.views)
    return [view.ball for view in views if view.ball is not None]


def _worst_size_ratio(solution: Solution) -> float | None:
    ratios = [fit.size_ratio for fit in _ball_fits(solution) if fit.size_ratio]
    return max(ratios, key=lambda ratio: abs(math.log(ratio)), default=None)


def _first_ball_view(solution: Solution) -> ViewSolution | None:
    """The first view that the ball comes from, most often the main camera's."""
    return solution.view(solution.ball.views[0]) if solution.ball is not None else None


def _ball_distance(solution: Solution) -> float | None:
    first, ball = _first_ball_view(solution), solution.ball
    if first is None or ball is None or first.calibration.camera is None:
        return None
    return math.dist(ball.point, first.calibration.camera.position.tolist())


def _find_box_diameter(group: Group, solution: Solution) -> float | None:
    annotated = {
        view.key: view.ball.box.diameter if view.ball.box is not None else None
        for view in group.views
        if view.included and view.ball is not None
    }
    first = _first_ball_view(solution)
    if first is None:
        return next((diameter for diameter in annotated.values() if diameter is not None), None)
    optimized = first.ball.optimized_diameter_px if first.ball is not None else None
    return annotated.get(first.view) or optimized
