"""The closed sets of words that files, requests and commands share; each is written here alone.

Tuples of them stand where they are used (``get_args``). Nothing is imported, so that the command line starts fast.
"""

from __future__ import annotations

from typing import Literal

CalibrationChoice = Literal["given", "lines"]
"""Which calibration of a camera counts: the one that came with the data, or that of its lines."""
BoxKind = Literal["optimized", "annotated", "exact"]
"""Which box of a ball counts."""
PolicyName = Literal["paper", "strict", "touchline"]
"""The policies that Touchline brings along."""
VerdictState = Literal["unreviewed", "accepted", "rejected", "deferred"]
"""What people said of a group."""
VersionRule = Literal["accepted", "passing"]
"""Which groups enter a version: those that people accepted, or whatever passes and is neither rejected nor deferred."""
LiveRule = Literal["passing", "accepted", "all"]
"""Which groups take part in an evaluation against a dataset that is not frozen."""
SplitKind = Literal["given", "match", "camera"]
"""How a version is split into train and test."""
ProposalOutcome = Literal["proposed", "unsure", "nothing"]
"""What can become of a view for which lines are sought in the paint of its picture."""
PredictionFormat = Literal["coco", "yolo", "csv", "tracks"]
"""How files of predictions are written."""
AnyPredictionFormat = Literal["auto", PredictionFormat]
"""The same, or as the endings of the files tell."""
PicturesSent = Literal["none", "copy"]
"""What an export of a server does with frames."""
PicturesWritten = Literal[PicturesSent, "link"]
"""What an export into a folder of this machine does with frames."""
TrainingViews = Literal["valid", "all"]
"""Which views training data are made from: those in which the 3D ball holds, or all."""
ShotKind = Literal["main", "replay", "closeup", "other"]
"""What a shot of a recording shows."""
ShotStart = Literal["start", "cut", "dissolve", "wipe", "fade"]
"""How a shot begins."""
LinkOutcome = Literal["none", "offset", "linked", "unobservable"]
"""What is known of the times of a replay: nothing, where it begins, all, or that it cannot be told."""
LinkSource = Literal["instants", "ball"]
"""What the times of a replay were found from."""
GoldStart = Literal["imported", "without_balls", "bare"]
"""What annotators of a gold group begin with."""
BatchState = Literal["open", "closed"]
"""Whether groups are still given out of a batch."""
JobState = Literal["waiting", "running", "done", "failed", "cancelled"]
"""How far long work is."""
BallEventKind = Literal["kick", "bounce", "out"]
"""What happened to the ball."""


ImportFormat = Literal[
    "soccernet-v3",
    "soccernet-v3d",
    "issia",
    "issia-3d",
    "sn-calibration",
    "cameras",
    "gamestate",
    "coco",
    "parquet",
    "frames",
    "touchline",
]
"""YOLO labels hold no cameras, lines or groups: they are predictions."""

CommandFormat = Literal[ImportFormat, "video"]
"""What the command ``import`` takes: recordings have requests of their own."""

ExportFormat = Literal[
    "soccernet-v3d",
    "soccernet-v3",
    "issia-3d",
    "issia",
    "cameras",
    "sn-calibration",
    "gamestate",
    "coco",
    "yolo",
    "parquet",
    "tracks",
    "tracab",
    "cdf",
    "npz",
    "touchline",
]
GoalEdge = Literal["inner", "middle", "laws"]
"""What stands for posts, crossbar and lines. ``inner``: the inner edges of a goal, 7.32 x 2.44 m, as the
public evaluator has it; ``middle``: the middle of its frame, 7.44 x 2.50 m, where people click; ``laws``:
that, and the middle of each line's paint, which lies half a line inside the plan, because the Laws
measure to the outer edges."""
