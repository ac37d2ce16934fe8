"""Predicted tracks against true ones: how far the ball is, how much of it there is, how sure, and its events."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from app.errors import InputError
from app.evaluation.bootstrap import RESAMPLES, SEED, MatchResamples
from app.evaluation.prediction_run import PredictedTrack
from app.evaluation.prediction_table import KINDS
from app.evaluation.result import (
    Axis,
    Cell,
    Chart,
    Column,
    Evaluation,
    Panel,
    ReferenceLine,
    Row,
    Series,
    Table,
)
from app.geometry.arrays import BoolArray, FloatArray, IntArray
from app.wording import plural

NEAR_M = 2.0
EVENT_FRAMES = 2
"""Between an event that is predicted and the true one that it is."""
INSIDE_95 = 7.815
"""Chi-squared with three degrees of freedom."""
_MOST_STEPS = 1.5
"""Times the interval of true frames that predictions may be apart, each of which counts for all frames near it."""
FARTHEST_M, STEP_M = 5.0, 0.05
NAMED, PANELS = 5, 6
"""Stretches that a note names, and that have a panel of their own; all are counted."""
COLUMNS = (
    Column("mae_m", "MAE", "m", "lower"),
    Column("median_m", "Median", "m", "lower"),
    Column("p_2m", "P 2 m", "", "higher"),
    Column("p_2m_all", "P 2 m, all frames", "", "higher"),
    Column("coverage", "Coverage", "", "higher"),
    Column("inside_95", "Inside 95 %"),
)
EVENT_COLUMNS = (
    Column("precision", "Precision", "", "higher"),
    Column("recall", "Recall", "", "higher"),
    Column("f1", "F1", "", "higher"),
)
_ROWS = (
    ("measured", "Two views or more saw it", ("measured",)),
    ("one_view", "One view saw it", ("one_view",)),
    ("unseen", "No view saw it", ("bridged", "predicted")),
)
_CURVES: tuple[tuple[str, str, Literal["line", "dashed"]], ...] = (
    ("compared", "Predicted", "line"),
    ("all", "All frames", "dashed"),
)
_MODES = (
    ("flight", "In the air"),
    ("roll", "On the grass"),
    ("held", "Held"),
    ("out", "Out of play"),
)


@dataclass(frozen=True)
class GroundTruthTrack:
    """The ball over a stretch, as people accepted it.

    Attributes:
        key: Of the stretch.
        folder: What exports call it.
        frames: Numbers, increasing, shape (N,).
        times: Seconds, shape (N,).
        position: Pitch frame, metres, NaN in gaps, shape (N, 3).
        state: How each frame is known.
        mode: What the ball does.
        events: Kind and seconds of each.
    """

    key: str
    folder: str
    frames: IntArray
    times: FloatArray
    position: FloatArray
    state: tuple[str, ...]
    mode: tuple[str, ...]
    events: tuple[tuple[str, float], ...]

    @property
    def has_ball(self) -> BoolArray:
        """Frames with a ball, shape (N,)."""
        return np.asarray(np.isfinite(self.position).all(axis=1))


@dataclass
class _AllTracksComparison:
    """True frames with a ball, one after the other, beside what was predicted for them.

    Attributes:
        error: Metres, NaN where nothing was predicted.
        inside: 1 where the truth is inside of what the prediction calls 95 %, 0 where not, NaN without
            a sigma.
        stretch, frame, state, mode: Of each.
        beside: Predicted balls of instants that have no true one.
        events: By stretch: kinds and seconds of true events, of predicted ones (None: none are
            predicted), and how far apart one and the same may be, seconds.
    """

    error: list[float] = field(default_factory=list)
    inside: list[float] = field(default_factory=list)
    stretch: list[str] = field(default_factory=list)
    frame: list[int] = field(default_factory=list)
    state: list[str] = field(default_factory=list)
    mode: list[str] = field(default_factory=list)
    beside: int = 0
    events: list[tuple[list[tuple[str, float]], list[tuple[str, float]], float]] = field(
        default_factory=list
    )


def evaluate_tracks(
    truth: Sequence[GroundTruthTrack], predicted: Mapping[str, PredictedTrack]
) -> Evaluation:
    """Tables and figures of predicted tracks.

    Args:
        truth: The true ones.
        predicted: By stretch, as its key or as exports call its folder; the empty name is the only
            stretch's.

    Raises:
        InputError: Nothing that is predicted is of an instant with a true ball.
    """
    own, unknown = _match_tracks(truth, predicted)
    found = _AllTracksComparison()
    for track in truth:
        _add_track_to_comparison(found, track, own.get(track.key))
    error = np.array(found.error)
    if not np.isfinite(error).any():
        raise InputError(
            "no predicted frame is one in which the true ball position is known:"
            f" {_describe_names('the stretches', [track.key for track in truth])}{_describe_names('; predicted', unknown) if unknown else ''}",
            hint="Give each folder of predictions the name of its stretch, and use the frame"
            " numbers that an export of tracks uses.",
            pointer="/predictions",
        )
    missed = [track.key for track in truth if track.key not in own]
    counts = {
        "track_stretches": len(truth),
        "stretches_not_predicted": len(missed),
        "predicted_stretches_unknown": len(unknown),
        "track_frames": len(error),
        "track_frames_compared": int(np.isfinite(error).sum()),
        "predicted_frames": sum(len(item.position) for item in predicted.values()),
        "predicted_frames_without_truth": found.beside
        + sum(len(predicted[name].position) for name in unknown),
    }
    note = _describe_counts(counts, missed, unknown)
    tables = [_make_positions_table(found, note)]
    if found.events:
        tables.append(_make_events_table(found))
    figures = (_make_share_within_distance_figure(error), _make_error_by_frame_figure(found))
    return Evaluation(counts, tuple(tables), figures, ())


def _match_tracks(
    truth: Sequence[GroundTruthTrack], predicted: Mapping[str, PredictedTrack]
) -> tuple[dict[str, PredictedTrack], list[str]]:
    """Predictions by key of their stretch, and the names of those that are of none."""
    names = {name.casefold(): track.key for track in truth for name in (track.folder, track.key)}
    found: dict[str, PredictedTrack] = {}
    unknown = []
    for name, track in sorted(predicted.items()):
        key = names.get(name.casefold())
        if key is None and len(truth) == 1 and len(predicted) == 1:
            key = truth[0].key
        if key is None or key in found:
            unknown.append(name or "the file at the top")
        else:
            found[key] = track
    return found, unknown


def _add_track_to_comparison(
    found: _AllTracksComparison, track: GroundTruthTrack, predicted: PredictedTrack | None
) -> None:
    there = track.has_ball
    rows, apart = np.full(len(track.frames), -1), np.zeros(len(track.frames))
    if predicted is not None:
        rows, apart, found_beside = _match_predictions_to_rows(track, predicted)
        found.beside += found_beside
        if predicted.events is not None:
            found.events.append(_collect_track_events(track, predicted))
    truth = _interpolate_true_positions(track, apart)
    position = np.array([] if predicted is None else predicted.position).reshape(-1, 3)
    sigma = np.zeros((0, 3)) if predicted is None else predicted.sigma_array
    for row in np.flatnonzero(there):
        at = int(rows[row])
        off = position[at] - truth[row] if at >= 0 else np.full(3, np.nan)
        square = float(((off / sigma[at]) ** 2).sum()) if at >= 0 else float("nan")
        found.error.append(float(np.linalg.norm(off)))
        found.inside.append(float(square <= INSIDE_95) if np.isfinite(square) else float("nan"))
        found.stretch.append(track.key)
        found.frame.append(int(track.frames[row]))
        found.state.append(track.state[row])
        found.mode.append(track.mode[row])


def _match_predictions_to_rows(
    track: GroundTruthTrack, predicted: PredictedTrack
) -> tuple[IntArray, FloatArray, int]:
    """The prediction of each true frame: of its number, or the nearest in time where it has no number.

    Returns:
        Its place, -1 where there is none, shape (N,); by how much it is later than the frame, seconds, 0 for
        frame numbers, shape (N,); how many predictions are of no frame with a true ball.
    """
    rows, apart = np.full(len(track.frames), -1), np.zeros(len(track.frames))
    by_frame = {int(frame): row for row, frame in enumerate(track.frames)}
    there, beside = track.has_ball, 0
    for at, frame in enumerate(predicted.frames):
        if frame is None:
            continue
        row = by_frame.get(frame, -1)
        beside += row < 0 or not there[row]
        if row >= 0 and rows[row] < 0:
            rows[row] = at
    timed = [
        (time, at)
        for at, (frame, time) in enumerate(zip(predicted.frames, predicted.times, strict=True))
        if frame is None and time is not None
    ]
    if timed:
        times, places = (np.array(column) for column in zip(*sorted(timed), strict=True))
        step = _estimate_frame_interval_s(track)
        rate = float(np.median(np.diff(times))) if len(times) > 1 else step
        # Fewer predictions a second than frames: some frames are farther than half a frame from all.
        slack = min(max(step, rate), _MOST_STEPS * step) / 2 + 1e-6
        near = _find_nearest(times, track.times)
        late = times[near] - track.times
        free = (rows < 0) & (np.abs(late) <= slack)
        rows[free], apart[free] = places[near[free]], late[free]
        own = _find_nearest(track.times, times)
        beside += int((~there[own] | (np.abs(track.times[own] - times) > slack)).sum())
    return rows, apart, beside


def _find_nearest(times: FloatArray, asked: FloatArray) -> IntArray:
    """Places of the increasing times that are nearest to each asked one, the earlier of two, shape (M,)."""
    after = np.clip(np.searchsorted(times, asked), 0, len(times) - 1)
    before = np.maximum(after - 1, 0)
    nearer = np.abs(times[before] - asked) <= np.abs(times[after] - asked)
    found: IntArray = np.where(nearer, before, after)
    return found


def _interpolate_true_positions(track: GroundTruthTrack, later: FloatArray) -> FloatArray:
    """Where the true ball is at each frame and so many seconds later, metres, shape (N, 3).

    On the straight line to the next frame on that side, or on with the velocity from the other side where that
    has no ball.
    """
    there, last = track.has_ball, len(track.times) - 1
    at = np.arange(last + 1)
    toward = np.where(later > 0, 1, -1)
    other = at
    for side in (-toward, toward):
        beside = np.clip(at + side, 0, last)
        other = np.where(there[beside] & (beside != at), beside, other)
    span = track.times[other] - track.times
    share = np.divide(later, span, out=np.zeros(len(at)), where=span != 0)
    moved: FloatArray = track.position + share[:, None] * (track.position[other] - track.position)
    return moved


def _estimate_frame_interval_s(track: GroundTruthTrack) -> float:
    return float(np.median(np.diff(track.times))) if len(track.times) > 1 else 0.04


def _collect_track_events(
    track: GroundTruthTrack, predicted: PredictedTrack
) -> tuple[list[tuple[str, float]], list[tuple[str, float]], float]:
    by_frame = {
        int(frame): float(time) for frame, time in zip(track.frames, track.times, strict=True)
    }
    step = _estimate_frame_interval_s(track)
    said = []
    for kind, frame, time in predicted.events or ():
        if frame is not None and frame in by_frame:
            said.append((kind, by_frame[frame]))
        else:
            said.append((kind, float("inf") if time is None else time))
    # A frame number is up to half a frame from the event's own time.
    rounded = any(frame is not None for _, frame, _ in predicted.events or ())
    return list(track.events), said, (EVENT_FRAMES + rounded / 2) * step + 1e-6


def _make_positions_table(found: _AllTracksComparison, note: str) -> Table:
    resamples = MatchResamples.draw(found.stretch, RESAMPLES, SEED)
    state, mode = np.array(found.state), np.array(found.mode)
    parts = [("all", "All frames", np.ones(len(state), dtype=bool))]
    parts += [(name, label, np.isin(state, names)) for name, label, names in _ROWS]
    parts += [(name, label, mode == name) for name, label in _MODES]
    if len(set(found.stretch)) > 1:
        keys = np.array(found.stretch)
        parts += [(f"stretch {key}", key, keys == key) for key in dict.fromkeys(found.stretch)]
    rows = [_make_position_row(found, resamples, *part) for part in parts if part[2].any()]
    return Table("tracks", "The ball over time", COLUMNS, tuple(rows), note)


def _make_position_row(
    found: _AllTracksComparison, resamples: MatchResamples, name: str, label: str, part: BoolArray
) -> Row:
    chosen = np.flatnonzero(part).tolist()
    of = len(chosen)
    placed = [at for at in chosen if np.isfinite(found.error[at])]
    errors = [found.error[at] for at in placed]
    stretches = [found.stretch[at] for at in placed]
    everywhere = [found.stretch[at] for at in chosen]
    near = [float(error < NEAR_M) for error in errors]
    near_all = [float(found.error[at] < NEAR_M) for at in chosen]
    sure = [at for at in placed if np.isfinite(found.inside[at])]
    inside = [found.inside[at] for at in sure]
    return Row(
        name,
        label,
        (
            resamples.mean_with_interval(errors, stretches, of),
            Cell(float(np.median(errors)) if errors else None, count=len(errors), of=of),
            resamples.mean_with_interval(near, stretches, of),
            resamples.mean_with_interval(near_all, everywhere),
            resamples.mean_with_interval(
                [float(np.isfinite(found.error[at])) for at in chosen], everywhere
            ),
            resamples.mean_with_interval(inside, [found.stretch[at] for at in sure], len(placed)),
        ),
    )


def _make_events_table(found: _AllTracksComparison) -> Table:
    rows = [_make_event_row("any", "Events of any kind", found, None)]
    rows += [
        _make_event_row(kind, f"{kind.capitalize()}s" if kind != "out" else "Out", found, kind)
        for kind in KINDS
    ]
    note = (
        f"Events are one and the same within {EVENT_FRAMES} frames, each once; rows of a kind compare those "
        "of that kind alone. Stretches without predicted events do not count."
    )
    return Table("track_events", "Events of the ball", EVENT_COLUMNS, tuple(rows), note)


def _make_event_row(name: str, label: str, found: _AllTracksComparison, kind: str | None) -> Row:
    true = said = hits = 0
    for real, predicted, slack in found.events:
        times = [
            sorted(at for one, at in some if kind in (None, one)) for some in (real, predicted)
        ]
        true, said = true + len(times[0]), said + len(times[1])
        hits += _count_matched_events(times[0], times[1], slack)
    f1 = 2 * hits / (true + said) if true + said else None
    return Row(
        name,
        label,
        (
            Cell(hits / said if said else None, count=hits, of=said),
            Cell(hits / true if true else None, count=hits, of=true),
            Cell(f1, count=2 * hits, of=true + said),
        ),
    )


def _count_matched_events(true: Sequence[float], said: Sequence[float], slack: float) -> int:
    """How many pairs of one and the same event there are, the most that are possible."""
    hits = at = 0
    for time in true:
        while at < len(said) and said[at] < time - slack:
            at += 1
        if at < len(said) and said[at] <= time + slack:
            hits, at = hits + 1, at + 1
    return hits


def _make_share_within_distance_figure(error: FloatArray) -> Chart:
    """Share of frames within a distance, against the distance."""
    places = (np.arange(round(FARTHEST_M / STEP_M) + 1) * STEP_M).round(6)
    below = np.searchsorted(np.sort(error[np.isfinite(error)]), places, side="left")
    whole = {"compared": int(np.isfinite(error).sum()), "all": len(error)}
    series = [
        Series(
            name,
            f"{label} (of {whole[name]})",
            tuple(places.tolist()),
            tuple((below / whole[name]).tolist()),
            kind,
            count=tuple(below.tolist()),
        )
        for name, label, kind in _CURVES
    ]
    panel = Panel(
        "Share within a distance",
        Axis("Distance from the ball", "m", 0.0, FARTHEST_M),
        Axis("Share of frames", "", 0.0, 1.0),
        tuple(series),
        (ReferenceLine("x", NEAR_M, "2 m"),),
    )
    note = "Solid: frames with a predicted ball. Dashed: all frames with a true one."
    return Chart("track_distance", "Precision of tracks against distance", (panel,), note)


def _make_error_by_frame_figure(found: _AllTracksComparison) -> Chart:
    """How far each predicted ball is off, against its frame, one panel for each stretch."""
    by_stretch: dict[str, list[tuple[float, float]]] = {}
    for stretch, frame, error in zip(found.stretch, found.frame, found.error, strict=True):
        if np.isfinite(error):
            by_stretch.setdefault(stretch, []).append((float(frame), error))
    worst = sorted(by_stretch, key=lambda key: -np.mean([error for _, error in by_stretch[key]]))
    panels = []
    for key in worst[:PANELS]:
        frames, errors = zip(*by_stretch[key], strict=True)
        series = Series("error", "Predicted", frames, errors, "points")
        axes = Axis("Frame"), Axis("Distance from the ball", "m", 0.0)
        panels.append(Panel(key, *axes, (series,), (ReferenceLine("y", NEAR_M, "2 m"),)))
    note = "A frame without a predicted ball has no point."
    if len(worst) > PANELS:
        note += f" The {PANELS} stretches with the largest MAE, of {len(worst)}."
    return Chart("track_error", "Error of tracks by frame", tuple(panels), note)


def _describe_counts(
    counts: Mapping[str, int], missed: Sequence[str], unknown: Sequence[str]
) -> str:
    said = [
        f"{plural(counts['track_frames'], 'frame')} with a true ball, "
        f"{counts['track_frames_compared']} with a predicted one too. MAE, median and P 2 m are over those; "
        "inside 95 % counts true places inside the 95 % ellipsoid of the predicted sigmas. A prediction with a time "
        "and no frame number is compared with the true ball at that time."
    ]
    if counts["predicted_frames_without_truth"]:
        balls = plural(counts["predicted_frames_without_truth"], "predicted ball")
        said.append(f"{balls} belong to frames without a true ball.")
    said += [_describe_names("Not predicted", missed) + "."] if missed else []
    said += (
        [_describe_names("Predicted, but no stretch of the truth", unknown) + "."]
        if unknown
        else []
    )
    return " ".join(said)


def _describe_names(what: str, names: Sequence[str]) -> str:
    more = f" and {len(names) - NAMED} more" if len(names) > NAMED else ""
    return f"{what}: {', '.join(names[:NAMED])}{more}"
