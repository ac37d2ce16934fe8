"""Names of the formats that can be imported and exported, as commands and requests spell them."""

from __future__ import annotations

from typing import Literal

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
