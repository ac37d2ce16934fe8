"""The group that docs/api.md speaks of: what the server answers of the sample's first one."""

from __future__ import annotations

import json
import re
import shutil
import tempfile
import zipfile
from functools import cache
from pathlib import Path
from typing import Any

import cv2
import httpx
import numpy as np

from tests.e2e.service import run_touchline, serving

GROUP_FILE = Path(__file__).resolve().parents[2] / "docs" / "examples" / "group.json"
WIDTH = 140
_INNERMOST = re.compile(r"[\[{][^\[\]{}]*[\]}]")


def fill_sample(folder: Path) -> None:
    """Put the first and the last match of ``make run``'s sample into the home in a folder.

    The whole sample would take three times as long. Pictures are plain, not drawn.
    """
    run_touchline(folder / "home", f"sample {folder / 'sample'} --labels-only --workers 1")
    first, *others, last = sorted((folder / "sample").rglob("Labels-v3.json"))
    for path in others:
        shutil.rmtree(path.parent)
    for path in (first, last):
        labels = json.loads(path.read_text("utf-8"))
        with zipfile.ZipFile(path.with_name("Frames-v3.zip"), "w") as frames:
            for name, view in (labels["actions"] | labels["replays"]).items():
                size = view["imageMetadata"]
                frames.writestr(name, plain_picture(size["width"], size["height"]))
    run_touchline(
        folder / "home",
        f"import soccernet-v3 {folder / 'sample'} --dataset sample",
        "solve --dataset sample --workers 1",
    )


@cache
def plain_picture(width: int, height: int) -> bytes:
    """A picture of grass alone, as PNG."""
    return cv2.imencode(".png", np.full((height, width, 3), (40, 120, 50), np.uint8))[1].tobytes()


def first_group(address: str) -> dict[str, Any]:
    """The first group, as a server answers it."""
    answer = httpx.get(f"{address}/api/v1/groups/1", timeout=60)
    return dict(answer.json())


def group_text(group: dict[str, Any]) -> str:
    """The group as JSON for people: lists and objects that fit into a line stand in one."""
    text = json.dumps(group, indent=1, ensure_ascii=False)
    while (shorter := _INNERMOST.sub(_in_one_line, text)) != text:
        text = shorter
    return (
        text.replace("\x01", "[").replace("\x02", "]").replace("\x03", "{").replace("\x04", "}")
        + "\n"
    )


def _in_one_line(found: re.Match[str]) -> str:
    """A list or object without its line ends where that is short; its brackets are done with."""
    line = re.sub(r"\s*\n\s*", " ", found[0])
    line = f"{line[0]}{line[1:-1].strip()}{line[-1]}"
    text = line if len(line) <= WIDTH else found[0]
    return text.translate(str.maketrans("[]{}", "\x01\x02\x03\x04"))


def group_page() -> str:
    """What docs/examples/group.json has to say."""
    with tempfile.TemporaryDirectory(prefix="touchline-docs-") as folder:
        fill_sample(Path(folder))
        with serving(Path(folder) / "home") as address:
            return group_text(first_group(address))
