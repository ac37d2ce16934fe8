"""Small COCO files of other tools, in the shapes in which they write theirs."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

Item = dict[str, Any]

BOX = (90.0, 40.0, 20.0, 20.0)


def image(name: str = "a.jpg", identity: Any = 1, **more: Any) -> Item:
    """A record of an image."""
    return {"id": identity, "file_name": name, "width": 1280, "height": 720, **more}


def ball(image_id: Any = 1, identity: Any = 1, category: Any = 1, **more: Any) -> Item:
    """An annotation of the ball."""
    return {
        "id": identity,
        "image_id": image_id,
        "category_id": category,
        "bbox": list(BOX),
        "iscrowd": 0,
        **more,
    }


def category(name: str = "ball", identity: Any = 1, **more: Any) -> Item:
    """A category."""
    return {"id": identity, "name": name, **more}


def coco(
    images: Sequence[Any] = (), annotations: Sequence[Any] = (), categories: Any = None
) -> Item:
    """A file; of one image with one ball where nothing else is given."""
    return {
        "images": list(images) or [image()],
        "annotations": list(annotations) or [ball()],
        "categories": [category(), category("Player", 2)] if categories is None else categories,
    }


def write(root: Path, files: dict[str, Any]) -> Path:
    """Files below a folder: JSON from values, pictures from texts."""
    for name, content in files.items():
        path = root / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(content if isinstance(content, str) else json.dumps(content))
    return root


WriteFiles = Callable[[dict[str, Any]], Path]
