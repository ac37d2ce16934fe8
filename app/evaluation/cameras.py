"""Cameras: how well cameras fit the annotated lines of many frames (JaC and the challenge's score), also a marking that
they were not shown.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from app.evaluation.bootstrap import MatchResamples
from app.evaluation.frame import GroundTruthFrame
from app.evaluation.result import (
    Axis,
    Cell,
    Chart,
    Column,
    FrameFieldRange,
    Panel,
    ReferenceLine,
    Row,
    Series,
    Table,
)
from app.geometry.camera import Camera
from app.progress import ReportProgress
from app.soccer.annotation import Lines, make_lines
from app.soccer.frames import ImageSize
from app.soccer.pitch import Pitch
from app.soccer.policy import CalibrationPolicy
from app.soccer.solution import GAMMAS_PERCENT
from app.solving.calibrate import calibrate
from app.solving.jaccard import (
    camera_jaccard,
    classify_markings,
    jaccard,
    measure_markings,
    project_markings,
)
from app.solving.match_position import NO_PLACES, FrameCameraPlaces, calibrate_with_match_position
from app.solving.observations import make_observations
from app.solving.resect import ResectionProblem
from app.wording import plural

SHARE_ABOVE = 0.75
CHALLENGE_PX = 5.0
"""Threshold of the sn-calibration challenge."""


@dataclass(frozen=True)
class FrameScore:
    """One camera against the lines of its frame.

    Attributes:
        jac: At each of ``GAMMAS_PERCENT``.
        challenge: JaC at 5 px, the better of the labels as given and turned by 180 degrees.
        distances_px: Of the annotated points whose marking is visible.
    """

    jac: tuple[float, ...]
    challenge: float
    distances_px: tuple[float, ...]


@dataclass(frozen=True)
class OverallCameraScore:
    """Many frames together; a frame without a camera counts as 0 everywhere."""

    frames: int
    calibrated: int
    jac: tuple[float, ...]
    share: float
    challenge: float
    error_median_px: float | None
    error_p95_px: float | None

    @property
    def completeness(self) -> float:
        """Share of the frames that have a camera."""
        return self.calibrated / self.frames if self.frames else 0.0


def score_frame(camera: Camera, lines: Lines, pitch: Pitch, size: ImageSize) -> FrameScore:
    """One camera against the lines of its frame, pixels of ``size``."""
    pitch = pitch.with_goal_edge("inner")
    measured = measure_markings(project_markings(camera, pitch, size), lines)
    jac = tuple(
        jaccard(classify_markings(measured, lines, gamma / 100 * size.diagonal))
        for gamma in GAMMAS_PERCENT
    )
    (challenge,) = camera_jaccard(camera, lines, pitch, size, (CHALLENGE_PX,), symmetric=True)
    distances = tuple(
        distance for seen in measured.values() for distance in seen.distances.tolist()
    )
    return FrameScore(jac, challenge, distances)


def combine_frame_scores(frames: Iterable[FrameScore | None]) -> OverallCameraScore:
    """Many frames together; None stands for a frame without a camera."""
    every = list(frames)
    found = [frame for frame in every if frame is not None]
    count = max(len(every), 1)
    jac = np.array([frame.jac for frame in found]).reshape(-1, len(GAMMAS_PERCENT))
    distances = np.array([distance for frame in found for distance in frame.distances_px])
    median, p95 = np.percentile(distances, [50, 95]).tolist() if len(distances) else (None, None)
    return OverallCameraScore(
        frames=len(every),
        calibrated=len(found),
        jac=tuple((jac.sum(axis=0) / count).tolist()),
        share=float((jac[:, 0] > SHARE_ABOVE).sum() / count),
        challenge=sum(frame.challenge for frame in found) / count,
        error_median_px=median,
        error_p95_px=p95,
    )


def measure_leave_one_out_errors(
    lines: Lines,
    pitch: Pitch,
    size: ImageSize,
    policy: CalibrationPolicy,
    others: FrameCameraPlaces = NO_PLACES,
) -> Iterator[tuple[str, float | None]]:
    """Each marking with the largest distance of its points from where the others put it.

    Args:
        lines: Annotated points by marking, pixels of ``size``.
        pitch: The pitch.
        size: Annotated size.
        policy: How the others are calibrated.
        others: Places of the match's other frames, if its camera's position is shared.

    Yields:
        Marking and pixels; None where the others do not give a camera.
    """
    for marking in lines:
        yield marking, measure_error_without_marking(lines, marking, pitch, size, policy, others)


def measure_error_without_marking(
    lines: Lines,
    marking: str,
    pitch: Pitch,
    size: ImageSize,
    policy: CalibrationPolicy,
    others: FrameCameraPlaces = NO_PLACES,
) -> float | None:
    """Largest distance of a marking's points from where the others put it, pixels."""
    rest = make_lines({name: points for name, points in lines.items() if name != marking})
    alone = calibrate(rest, pitch, size, policy)
    camera = calibrate_with_match_position(alone, others, rest, pitch, size, policy).camera
    if camera is None:
        return None
    problem = ResectionProblem.of(size, policy)
    seen = make_observations(
        make_lines({marking: lines[marking]}), policy.pitch_for_fitted_lines(pitch), size
    )
    return float(problem.distances(problem.parameters(camera), seen).max())


COLUMNS = (
    Column("completeness", "Calibrated", "", "higher"),
    *(Column(f"jac_{gamma:g}", f"JaC {gamma:g} %", "", "higher") for gamma in GAMMAS_PERCENT),
    Column("share", f"JaC 0.5 % > {SHARE_ABOVE:g}", "", "higher"),
    Column("challenge", "Challenge score (5 px)", "", "higher"),
    Column("error_median_px", "Median error", "px", "lower"),
    Column("error_p95_px", "95 % error", "px", "lower"),
)
JAC_LIMITS = np.arange(0, 101) / 100
Scores = dict[int, FrameScore | None]
"""By id of the frame; None: annotated lines, and no camera."""


def score_cameras(
    frames: Sequence[GroundTruthFrame],
    cameras: Mapping[int, Camera],
    progress: ReportProgress | None = None,
) -> Scores:
    """Every frame with lines against its camera; a static camera's same lines are measured once."""
    scores: Scores = {}
    known: dict[tuple[str, Camera, Pitch, ImageSize], FrameScore] = {}
    for number, frame in enumerate(frames):
        if progress is not None:
            progress(number)
        if not frame.lines:
            continue
        camera = cameras.get(frame.id)
        if camera is None:
            scores[frame.id] = None
            continue
        key = (frame.station or str(frame.id), camera, frame.pitch, frame.size)
        if key not in known:
            known[key] = score_frame(camera, frame.lines, frame.pitch, frame.size)
        scores[frame.id] = known[key]
    return scores


def make_cameras_table(
    rows: Sequence[tuple[str, str, Scores]],
    frames: Sequence[GroundTruthFrame],
    resamples: MatchResamples,
    judged: Collection[int],
) -> Table:
    """One row per set of cameras, over all frames with lines; a frame without camera counts 0.

    Args:
        rows: Name, words and scores of each set of cameras.
        frames: Of the dataset.
        resamples: For the intervals.
        judged: Ids of the frames that a run lists.
    """
    match = {frame.id: frame.match for frame in frames}
    made = tuple(
        _make_score_row(name, label, scores, match, resamples) for name, label, scores in rows
    )
    count = len(rows[0][2]) if rows else 0
    unseen = sum(frame not in judged for frame in (rows[0][2] if rows else ()))
    note = (
        f"{plural(count, 'frame')} with annotated lines; JaC, share and challenge score count a frame "
        f"without a camera as 0. The challenge score takes the better of the labels as given and "
        f"turned by 180 degrees; JaC does not."
    )
    if unseen:
        note += (
            f" The list of frames has {count - unseen} of them: the ball of the other {unseen} is "
            f"not known, so they count only in this table."
        )
    return Table("calibration", "Calibration against annotated lines", COLUMNS, made, note)


def make_jac_figure(rows: Sequence[tuple[str, str, Scores]], min_jac: float) -> Chart:
    """Share of frames whose JaC is above a threshold, for each gamma."""
    panels = tuple(_make_jac_panel(name, label, scores, min_jac) for name, label, scores in rows)
    note = (
        f"{len(rows[0][2]) if rows else 0} frames with annotated lines. Points of the predicted "
        f"cameras at γ = {GAMMAS_PERCENT[0]:g} % open their frames."
    )
    return Chart("jac", "Frames above a JaC", panels, note)


def _make_score_row(
    name: str, label: str, scores: Scores, match: Mapping[int, str], resamples: MatchResamples
) -> Row:
    total, count = combine_frame_scores(scores.values()), len(scores)
    matches = [match[frame] for frame in scores]
    found = list(scores.values())

    def make_mean_cell(value: Callable[[FrameScore], float]) -> Cell:
        values = [0.0 if item is None else value(item) for item in found]
        return resamples.mean_with_interval(values, matches)

    cells = (
        make_mean_cell(lambda _item: 1.0),
        *(
            make_mean_cell(lambda item, place=place: item.jac[place])  # type: ignore[misc]
            for place in range(len(GAMMAS_PERCENT))
        ),
        make_mean_cell(lambda item: float(item.jac[0] > SHARE_ABOVE)),
        make_mean_cell(lambda item: item.challenge),
        Cell(total.error_median_px, count=total.calibrated, of=count),
        Cell(total.error_p95_px, count=total.calibrated, of=count),
    )
    return Row(name, label, cells, FrameFieldRange("predicted_jac"))


def _make_jac_panel(name: str, label: str, scores: Scores, min_jac: float) -> Panel:
    values = np.array(
        [item.jac if item is not None else (0.0,) * len(GAMMAS_PERCENT) for item in scores.values()]
    ).reshape(-1, len(GAMMAS_PERCENT))
    series = []
    for place, gamma in enumerate(GAMMAS_PERCENT):
        above = (values[:, place, None] > JAC_LIMITS).sum(axis=0)
        share = above / max(len(values), 1)
        series.append(
            Series(
                f"gamma_{gamma:g}",
                f"γ = {gamma:g} %",
                tuple(JAC_LIMITS.tolist()),
                tuple(share.tolist()),
                count=tuple(above.tolist()),
                frames=_make_ranges_above_jac_limits()
                if name == "predicted" and place == 0
                else (),
            )
        )
    return Panel(
        label,
        Axis("JaC above", "", 0.0, 1.0),
        Axis("Share of frames", "", 0.0, 1.0),
        tuple(series),
        (ReferenceLine("x", min_jac, f"{min_jac:g}"),),
    )


def _make_ranges_above_jac_limits() -> tuple[FrameFieldRange, ...]:
    """The frames above each threshold itself, which a lower bound alone would take in."""
    bounds = (math.nextafter(threshold, math.inf) for threshold in JAC_LIMITS.tolist())
    return tuple(FrameFieldRange("predicted_jac", low=bound) for bound in bounds)
