"""Which image of a COCO file each annotation is of; whatever joins none is counted and named."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from app.finite import quoted
from app.formats.picture_finder import picture_parts
from app.formats.record_ids import IdIndex, id_text
from app.formats.report import Report

Annotation = tuple[str, Mapping[str, Any]]
"""Its place in the file (``annotations[3]``), and itself."""


class Joined:
    """The annotations of each image.

    Args:
        images: The list ``images``.
        annotations: The list ``annotations``.
        path: The file, for problems.
        report: Takes what joins no image, and what is there twice.

    Attributes:
        of_image: Annotations of each image, in the order of the file; captions are counted alone.
        captions: Whether all annotations are captions.
    """

    def __init__(
        self, images: Sequence[Any], annotations: Sequence[Any], path: str, report: Report
    ):
        self._path, self._report = path, report
        self._ids: IdIndex[int] = IdIndex()
        self._names: dict[str, list[int]] = {}
        self.of_image: list[list[Annotation]] = [[] for _ in images]
        for index, item in enumerate(images):
            self._add_image(index, item)
        captions = shared = 0
        seen: dict[str, Mapping[str, Any]] = {}
        for index, item in enumerate(annotations):
            record = f"annotations[{index}]"
            image = self._image(item, record)
            if image is None:
                continue
            if isinstance(item.get("caption"), str) and "category_id" not in item:
                captions += 1
                continue
            identity = id_text(item.get("id"))
            other = item if identity is None else seen.setdefault(identity, item)
            if other is not item and other == item:
                self._note(record, "id", f"is {identity}: the same annotation twice; left out")
                continue
            shared += other is not item
            self.of_image[image].append((record, item))
        self.captions = captions > 0 and captions == len(annotations)
        if captions:
            report.counts["captions"] += captions
        if shared:
            report.remark(
                f"{path}: {shared:,} annotations have the id of another one; all are read"
            )

    def is_alone(self, name: str) -> bool:
        """Whether one image alone has a name, as the last part of its own."""
        return len(self._names.get(name, [])) == 1

    def _note(self, record: str, field: str | None, problem: str) -> None:
        self._report.note(self._path, record, field, problem)

    def _add_image(self, index: int, item: Any) -> None:
        if not isinstance(item, dict):
            return
        if parts := _parts(item.get("file_name")):
            self._names.setdefault(parts[-1], []).append(index)
        value = item.get("id")
        if not self._ids.add(value, index):
            known = id_text(value) is not None
            problem = f"is {spelt(value)}, as another image's is" if known else "is missing"
            self._note(f"images[{index}]", "id", f"{problem}; no annotation joins this image")

    def _image(self, item: Any, record: str) -> int | None:
        """The image of an annotation, by its id or else by its name; None is reported."""
        if not isinstance(item, dict):
            self._note(record, None, "is not an object; left out")
            return None
        if "image_id" not in item:
            self._note(record, "image_id", "is missing; left out")
            return None
        value = item["image_id"]
        image = self._ids.find(value)
        if image is None and (parts := _parts(value)) and self.is_alone(parts[-1]):
            return self._names[parts[-1]][0]
        if image is None:
            self._report.counts["annotations without image"] += 1
            problem = f"is {spelt(value)}, which no image of the file has; left out"
            self._note(record, "image_id", problem)
        return image


def spelt(value: Any) -> str:
    """A value as the file spells it, no longer than a sentence can take."""
    if isinstance(value, str):
        return quoted(value, 40)
    return "null" if value is None else str(value)[:40]


def _parts(name: Any) -> tuple[str, ...]:
    return picture_parts(name) if isinstance(name, str) else ()
