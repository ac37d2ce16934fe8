"""Calibrate: the camera of one view from its annotated lines, with everything that judges it."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from dataclasses import replace
from types import MappingProxyType

import numpy as np

from app.errors import DegenerateGeometryError
from app.geometry.arrays import FloatArray, flatten_covariance
from app.geometry.camera import Camera
from app.geometry.resection import LOG_FOCAL, PARAMETERS, X, Z
from app.json_text import digest_content
from app.soccer.annotation import Lines
from app.soccer.frames import ImagePoint, ImageSize
from app.soccer.group import Group, SharedPosition, Station, View
from app.soccer.paint_evidence import PAINT_DISAGREES, PaintReading
from app.soccer.picture import PictureGeometry
from app.soccer.pitch import Pitch
from app.soccer.policy import CalibrationPolicy
from app.soccer.solution import (
    GAMMAS_PERCENT,
    SOLVER_VERSION,
    Calibration,
    MarkingFit,
    PaintFit,
    SuspectLabel,
)
from app.solving.camera_positions import PositionPrior, make_match_position_prior
from app.solving.jaccard import (
    ProjectedMarking,
    classify_markings,
    find_unannotated_not_missing,
    jaccard,
    measure_markings,
    project_markings,
    project_markings_like_evaluator,
)
from app.solving.labels import find_suspects, measure_mirrored_lines
from app.solving.lone_frame import LoneFrameUncertainty, estimate_lone_frame_uncertainty
from app.solving.observations import Observations, make_observations
from app.solving.paint_camera import PaintProblem, solve_paint
from app.solving.picture_camera import (
    WIDTH,
    PictureProblem,
    estimate_picture,
    find_picture_distortion,
    picture_to_warp,
)
from app.solving.resect import (
    REFERENCE_DIAGONAL,
    Resection,
    ResectionProblem,
    count_measurements,
)
from app.solving.tripod_pitch import second_moment_about_plan
from app.wording import plural

MIN_MEASUREMENTS = 7
"""A camera with one focal length has seven unknowns; the distortion has a prior."""

NONE_KNOWN: Mapping[str, Calibration] = MappingProxyType({})

DRAWN_DIGITS = 3
"""Decimals of a pixel that are kept of places and lengths; distances keep every bit."""

START_VERSION = "8"
"""Raised by one whenever the same clicks give another camera: from there paint is sought."""

MAX_POSITION_SIGMA_M = 5.0
MAX_FOCAL_SIGMA = 0.10
"""Above these the position (metres) or focal length (share) counts as not observable."""


def calibrate(
    lines: Lines, pitch: Pitch, size: ImageSize, policy: CalibrationPolicy
) -> Calibration:
    """Calibration of one image from its lines; its camera is None where they do not suffice.

    Args:
        lines: Annotated points by marking, pixels of ``size``.
        pitch: The pitch.
        size: Annotated size.
        policy: Robust scale, prior of the distortion, whether labels are checked.
    """
    pitch = policy.pitch_for_fitted_lines(pitch)
    observations = make_observations(lines, pitch, size)
    measurements = count_measurements(observations)
    if measurements < MIN_MEASUREMENTS:
        count = len(observations.markings)
        reason = (
            f"{plural(count, 'marking gives', 'markings give')} {measurements} "
            f"independent measurements, a camera needs {MIN_MEASUREMENTS}"
        )
        return Calibration("lines", None, reason=reason)
    problem = ResectionProblem.of(size, policy)
    fit = problem.resect(observations)
    suspects: tuple[SuspectLabel, ...] = ()
    if policy.check_labels:
        fit, observations, suspects = find_suspects(problem, observations, fit)
    fit = problem.refine_with_main_prior(fit, observations)
    mirrored_px = measure_mirrored_lines(problem, fit, make_observations(lines, pitch, size))
    picture = find_picture_distortion(problem, fit.parameters, observations)
    found = replace(
        _make_calibration(problem, fit, observations),
        suspects=suspects,
        picture=picture,
        mirrored_px=mirrored_px,
    )
    return measure_calibration(
        found, lines, pitch, size, shortest_px=min_counted_marking_px(policy, size)
    )


def calibrate_near_position(
    alone: Calibration,
    near: PositionPrior,
    lines: Lines,
    pitch: Pitch,
    size: ImageSize,
    policy: CalibrationPolicy,
) -> Calibration:
    """A calibration once more with what other frames of the match say of the camera's position.

    Args:
        alone: What ``calibrate`` makes of the same lines.
        near: Prior of the position.
    """
    if alone.camera is None:
        return alone
    problem, pitch = ResectionProblem.of(size, policy), policy.pitch_for_fitted_lines(pitch)
    left_out = [suspect.marking for suspect in alone.suspects]
    observations = make_observations(lines, pitch, size).without(*left_out)
    fit = Resection(problem.parameters(alone.camera), 0.0)
    shared = problem.refine_with_match_position(fit, observations, near)
    if shared is fit:
        return alone
    found = _make_calibration(problem, shared, observations)
    # Whether the picture was stretched or cropped its own lines say, to the camera that fits them.
    found = replace(found, suspects=alone.suspects, picture=alone.picture)
    return measure_calibration(
        found, lines, pitch, size, shortest_px=min_counted_marking_px(policy, size)
    )


def calibrate_altered_picture(
    lines: Lines, pitch: Pitch, size: ImageSize, policy: CalibrationPolicy, picture: PictureGeometry
) -> Calibration:
    """``calibrate`` of a picture that was stretched or cropped since it was taken.

    The lines are taken back to the picture as it was, where that is exactly known or as they say
    themselves, and the camera is put into the picture as it is. Its covariance knows what is not
    known of the picture.

    Args:
        picture: What was done to it.
    """
    problem, pitch = ResectionProblem.of(size, policy), policy.pitch_for_fitted_lines(pitch)
    observations = make_observations(lines, pitch, size)
    if count_measurements(observations) < MIN_MEASUREMENTS:
        return calibrate(lines, pitch, size, policy)
    try:
        found = estimate_picture(problem, observations, picture)
        alone = calibrate(found.lines_in_original_picture(lines, size), pitch, size, policy)
        left_out = [suspect.marking for suspect in alone.suspects]
        if left_out:
            observations = observations.without(*left_out)
            found = estimate_picture(problem, observations, picture)
            alone = calibrate(found.lines_in_original_picture(lines, size), pitch, size, policy)
    except DegenerateGeometryError as error:
        return Calibration("lines", None, reason=error.message)
    if alone.camera is None:
        return alone
    covariance, whole = _covariances_with_picture(
        problem, observations, picture, found, alone.camera
    )
    return measure_calibration(
        replace(
            alone,
            camera=found.camera_of_annotated_picture(alone.camera, size),
            covariance=flatten_covariance(covariance) if np.isfinite(covariance).all() else None,
            unobservable=_list_unobservable_parameters(covariance),
            picture=None,
            picture_covariance=flatten_covariance(whole) if np.isfinite(whole).all() else None,
        ),
        lines,
        pitch,
        size,
        shortest_px=min_counted_marking_px(policy, size),
    )


def analyse_lone_frame(
    found: Calibration, lines: Lines, pitch: Pitch, size: ImageSize, policy: CalibrationPolicy
) -> LoneFrameUncertainty | None:
    """What nobody says of the pitch and the picture of a frame that was calibrated from its lines.

    Args:
        found: What ``calibrate`` makes of the lines.

    Returns:
        None without a camera, where its lines leave it open, and where the policy takes both for
        known.
    """
    if found.camera is None or found.covariance is None:
        return None
    problem = ResectionProblem.of(size, policy)
    left_out = [suspect.marking for suspect in found.suspects]
    pitch = policy.pitch_for_fitted_lines(pitch)
    observations = make_observations(lines, pitch, size)
    parameters = problem.parameters(found.camera)
    return estimate_lone_frame_uncertainty(
        problem, parameters, observations, pitch, policy, left_out
    )


def add_lone_frame_uncertainty(
    found: Calibration, alone: LoneFrameUncertainty | None, pitch: Pitch
) -> Calibration:
    """The calibration with that in its covariance, and with the other pitch that the lines show;
    what the lines determine they still do."""
    if alone is None:
        return found
    covariance = flatten_covariance(alone.covariance)
    return replace(found, covariance=covariance, other_pitch=alone.find_other_pitch(pitch))


def _covariances_with_picture(
    problem: ResectionProblem,
    observations: Observations,
    prior: PictureGeometry,
    found: PictureGeometry,
    camera: Camera,
) -> tuple[FloatArray, FloatArray]:
    """Covariance of a camera's parameters with what is not known of its picture, shape (8, 8), and
    that of camera and picture together, shape (11, 11)."""
    search = PictureProblem.of(problem, observations, prior)
    unknowns = np.append(problem.parameters(camera), picture_to_warp(found))
    try:
        whole = search.covariance(unknowns)
    except DegenerateGeometryError:
        return np.full((PARAMETERS, PARAMETERS), np.inf), np.full((WIDTH, WIDTH), np.inf)
    return search.fold_picture_into_camera_covariance(unknowns, whole), whole


def _make_calibration(
    problem: ResectionProblem, fit: Resection, observations: Observations
) -> Calibration:
    """The camera and how well the lines determine it; the priors count for nothing there."""
    try:
        covariance = problem.line_noise(fit.parameters, observations).parameters
    except DegenerateGeometryError:
        covariance = np.full((PARAMETERS, PARAMETERS), np.inf)
    return Calibration(
        "lines",
        problem.camera(fit.parameters),
        covariance=flatten_covariance(covariance) if np.isfinite(covariance).all() else None,
        unobservable=_list_unobservable_parameters(covariance),
    )


def calibrate_station(
    station: Station,
    pitch: Pitch,
    policy: CalibrationPolicy,
    shared: SharedPosition | None = None,
) -> Calibration:
    """Calibration of a station: the given camera where that counts, else from its lines.

    ``shared`` is what other pictures of the match say of its position.
    """
    found = _calibrate_counting_all_markings(station, pitch, policy, shared)
    if not station.not_visible:
        return found
    return _measure_against_station(found, station, pitch, policy)


def _calibrate_counting_all_markings(
    station: Station, pitch: Pitch, policy: CalibrationPolicy, shared: SharedPosition | None
) -> Calibration:
    """``calibrate_station`` as if every visible marking was one that people draw."""
    if station.given is not None and station.calibration == "given":
        given = Calibration("given", station.given, covariance=station.given_covariance)
        return _measure_against_station(given, station, pitch, policy)
    if station.picture is not None:
        return calibrate_altered_picture(
            station.lines, pitch, station.size, policy, station.picture
        )
    alone = calibrate(station.lines, pitch, station.size, policy)
    if shared is None:
        return alone
    near = make_match_position_prior(np.array(shared.mean), np.array(shared.sigma))
    return calibrate_near_position(alone, near, station.lines, pitch, station.size, policy)


def _measure_against_station(
    found: Calibration, station: Station, pitch: Pitch, policy: CalibrationPolicy
) -> Calibration:
    """A calibration measured against the lines of its station, and what is said not to be visible."""
    size, shortest = station.size, min_counted_marking_px(policy, station.size)
    fitted = policy.pitch_for_fitted_lines(pitch)
    return measure_calibration(found, station.lines, fitted, size, station.not_visible, shortest)


def calibrate_from_paint(
    clicked: Calibration,
    reading: PaintReading,
    station: Station,
    pitch: Pitch,
    policy: CalibrationPolicy,
) -> Calibration:
    """A calibration of clicks with what was read of the paint in its picture.

    The camera is the paint's, with what the clicks know as prior; or it stays the clicks', with the
    reason in ``paint``.

    Args:
        clicked: The calibration that the paint was sought for.
        reading: What was read.
        station: With the clicks.
    """
    size = station.size
    fit = PaintFit(
        reading.supported, reading.explained, reading.evidence.count, reason=reading.reason
    )
    if clicked.camera is None or reading.reason is not None:
        return replace(clicked, paint=fit)
    resection = ResectionProblem.of(size, policy)
    known = None if clicked.covariance is None else np.reshape(clicked.covariance, (8, 8))
    problem = PaintProblem.of(resection, resection.parameters(clicked.camera), known)
    found = solve_paint(problem, reading.evidence, policy.pitch_for_fitted_lines(pitch))
    if found is None:
        return replace(clicked, paint=replace(fit, reason=PAINT_DISAGREES))
    pitch_covariance = found.pitch
    if reading.tripod is not None:
        camera, spread = map(np.array, reading.tripod)
        known_together = second_moment_about_plan(found.parameters, camera, spread.reshape(8, 8))
        pitch_covariance = known_together - found.covariance
    painted = replace(
        clicked,
        source="paint",
        camera=resection.camera(found.parameters),
        covariance=flatten_covariance(found.covariance),
        pitch_covariance=flatten_covariance(pitch_covariance),
        unobservable=_list_unobservable_parameters(found.covariance),
        paint=replace(fit, error_px=found.error_px),
    )
    return _measure_against_station(painted, station, pitch, policy)


def calibrate_view(
    group: Group,
    view: View,
    policy: CalibrationPolicy,
    known: Mapping[str, Calibration] = NONE_KNOWN,
) -> Calibration:
    """Calibration of a view: of its station, near the position that its match shares with it, and
    on the paint of its picture as far as the policy wants it.

    Args:
        group: What was said.
        view: One of its views.
        policy: What a calibration depends on.
        known: Calibrations by key; that of the clicks is not computed again where it is there.
    """
    key = compute_click_calibration_key(group, view, policy)
    found = known.get(key) or calibrate_from_clicks(group, view, policy)
    reading = find_wanted_paint_reading(group, view, policy)
    if reading is not None and reading.sought_for == compute_paint_search_key(group, view, policy):
        found = calibrate_from_paint(found, reading, view.station, group.pitch, policy)
    if found.source == "paint" or not is_lone_frame(group, view, policy):
        return found
    station = view.station
    alone = analyse_lone_frame(found, station.lines, group.pitch, station.size, policy)
    return add_lone_frame_uncertainty(found, alone, group.pitch)


def calibrate_from_clicks(group: Group, view: View, policy: CalibrationPolicy) -> Calibration:
    """``calibrate_view`` without paint."""
    return calibrate_station(
        view.station, group.pitch, policy, _find_usable_shared_position(group, view, policy)
    )


def compute_view_calibration_key(group: Group, view: View, policy: CalibrationPolicy) -> str:
    """Key of what ``calibrate_view`` makes."""
    return compute_view_calibration_keys(group, view, policy)[0]


def compute_view_calibration_keys(
    group: Group, view: View, policy: CalibrationPolicy
) -> tuple[str, ...]:
    """The same, and after it the key of the clicks that it starts from where it is another."""
    key = compute_click_calibration_key(group, view, policy)
    reading = find_wanted_paint_reading(group, view, policy)
    parts = [key]
    if reading is not None and reading.sought_for == compute_paint_search_key(group, view, policy):
        parts.append(reading.digest)
    if is_lone_frame(group, view, policy):
        parts.append(f"lone {policy.lone_frames}")
    return (key,) if len(parts) == 1 else (digest_content(" ".join(parts).encode()), key)


def compute_click_calibration_key(group: Group, view: View, policy: CalibrationPolicy) -> str:
    """``compute_calibration_key`` of what ``calibrate_from_clicks`` makes."""
    return compute_calibration_key(
        view.station, group.pitch, policy, _find_usable_shared_position(group, view, policy)
    )


def compute_paint_search_key(group: Group, view: View, policy: CalibrationPolicy) -> str:
    """Digest of what the camera depends on from which the paint of a view's picture is sought.

    How that camera is measured has no part in it, nor how noisy its clicks are: neither what counts
    as missing nor the estimated noise of a dataset moves a camera.
    """
    shared = _find_usable_shared_position(group, view, policy)
    quiet = replace(policy, line_sigma_px=None, line_share=None)
    return _digest_of_parts(
        _collect_camera_key_parts(START_VERSION, view.station, group.pitch, quiet, shared)
    )


def is_lone_frame(group: Group, view: View, policy: CalibrationPolicy) -> bool:
    """Whether nobody but its own lines says anything of the pitch and the picture of a view.

    Several views of one instant share their pitch: each by itself would be too uncertain.
    """
    station = view.station
    is_said = bool(group.match) or station.shared or station.picture is not None
    is_given = station.given is not None and station.calibration == "given"
    is_exact = policy.lone_frames == "exact" or group.pitch != Pitch()
    return not (is_exact or is_said or is_given) and len(group.views) == 1


def find_wanted_paint_reading(
    group: Group, view: View, policy: CalibrationPolicy
) -> PaintReading | None:
    """What was read for a view, as far as the policy wants it; perhaps for other clicks."""
    if policy.source != "paint" or not view.can_use_paint:
        return None
    return group.paint.get(view.key)


def _find_usable_shared_position(
    group: Group, view: View, policy: CalibrationPolicy
) -> SharedPosition | None:
    """The position of a view's match as far as the policy wants it and the camera moves."""
    if not policy.share_position or view.station.shared:
        return None
    return group.positions.get(view.key)


def min_counted_marking_px(policy: CalibrationPolicy, size: ImageSize) -> float:
    """Length below which an undrawn marking does not count as missing, pixels; 0: none is."""
    return policy.shortest_marking_px * size.diagonal / REFERENCE_DIAGONAL


def measure_calibration(
    calibration: Calibration,
    lines: Lines,
    pitch: Pitch,
    size: ImageSize,
    not_visible: Collection[str] = (),
    shortest_px: float = 0.0,
) -> Calibration:
    """The calibration with JaC and the distances of the annotated points filled in.

    Without lines there is no JaC; the projected markings are there all the same, but for those that
    nobody drew and that are ``find_unannotated_not_missing``. Distances are those to the goals and lines of ``pitch``,
    JaC and the outcomes that it counts are told by the evaluator's.
    """
    if calibration.camera is None:
        return calibration
    measured = measure_markings(project_markings(calibration.camera, pitch, size), lines)
    judged = project_markings_like_evaluator(calibration.camera, pitch, size, lines, measured)
    for marking in find_unannotated_not_missing(judged, lines, not_visible, shortest_px):
        del judged[marking]
    by_gamma = [
        classify_markings(judged, lines, gamma / 100 * size.diagonal) for gamma in GAMMAS_PERCENT
    ]
    left_out = {suspect.marking for suspect in calibration.suspects}
    markings = []
    for marking, outcome in by_gamma[0].items():
        fit = MarkingFit(marking, outcome, used=marking not in left_out)
        seen = measured.get(marking) or judged.get(marking)
        if seen is not None:
            nearest = np.round(seen.nearest, DRAWN_DIGITS).tolist()
            fit = replace(
                fit,
                distances_px=tuple(seen.distances.tolist()),
                nearest=tuple(map(ImagePoint._make, nearest)),
                length_px=round(seen.length, DRAWN_DIGITS),
            )
        counted = _largest_judged_distance(judged.get(marking))
        if counted != fit.counted_px:
            fit = replace(fit, judged_px=counted)
        markings.append(fit)
    distances = np.concatenate([np.array(fit.distances_px) for fit in markings] or [np.empty(0)])
    has_lines = any(lines.values())
    return replace(
        calibration,
        jac=tuple(jaccard(found) for found in by_gamma) if has_lines else None,
        goal=pitch.goal,
        error_px=float(np.median(distances)) if len(distances) else None,
        markings=tuple(markings),
    )


def _largest_judged_distance(judged: ProjectedMarking | None) -> float:
    """Largest distance of an annotated point, pixels; infinite where there is none to measure."""
    if judged is None or not len(judged.distances):
        return math.inf
    return float(judged.distances.max())


def compute_calibration_key(
    station: Station,
    pitch: Pitch,
    policy: CalibrationPolicy,
    shared: SharedPosition | None = None,
) -> str:
    """Digest of all that ``calibrate_station`` reads: the same key, the same calibration."""
    parts = _collect_camera_key_parts(SOLVER_VERSION, station, pitch, policy, shared)
    if station.not_visible:
        parts.append(repr(("not visible", station.not_visible)))
    if policy.shortest_marking_px:
        parts.append(repr(("shortest", policy.shortest_marking_px)))
    return _digest_of_parts(parts)


def _collect_camera_key_parts(
    version: str,
    station: Station,
    pitch: Pitch,
    policy: CalibrationPolicy,
    shared: SharedPosition | None,
) -> list[str]:
    """All that the camera of a station depends on; ``version`` is that of the code."""
    # Plain tuples are spelt out in half the time.
    lines = [(marking, [*map(tuple, points)]) for marking, points in sorted(station.lines.items())]
    parts = [*map(repr, (version, station.size, pitch)), policy.cached_repr, repr(lines)]
    if policy.goal != "inner":
        parts.append(repr(("goal", policy.goal)))
    if policy.weighed != "points":
        parts.append(repr(("weighed", policy.weighed)))
    if station.given is not None and station.calibration == "given":
        parts.append(repr(station.given.parameters.tolist()))
        if station.given.is_wide:
            parts.append(repr(station.given.lens))
        if station.given_covariance is not None:
            parts.append(repr(station.given_covariance))
        return parts
    if station.picture is not None:
        parts.append(repr(station.picture))
    elif shared is not None:
        parts.append(repr(shared))
    if (policy.line_sigma_px, policy.line_share) != (None, None):
        parts.append(repr(("line noise", policy.line_sigma_px, policy.line_share)))
    return parts


def _digest_of_parts(parts: list[str]) -> str:
    return digest_content(f"[{', '.join(parts)}]".encode())


def _list_unobservable_parameters(covariance: FloatArray) -> tuple[str, ...]:
    """Names of what the lines leave open, from the covariance of the parameters."""
    deviations = np.sqrt(np.diag(covariance))
    words = []
    if not np.hypot.reduce(deviations[X : Z + 1]) <= MAX_POSITION_SIGMA_M:
        words.append("position")
    if not deviations[LOG_FOCAL] <= MAX_FOCAL_SIGMA:
        words.append("focal length")
    return tuple(words)
