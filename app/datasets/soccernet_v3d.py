"""SoccerNet-v3D: names of its files."""

from __future__ import annotations

LABELS = "Labels-v3D.json"

TABLE = "SNv3D.csv"
SPLIT_FILES = {"train": "SNv3D-train.txt", "test": "SNv3D-test.txt"}
