"""Writes YOLO: labels, lists of pictures, and the file that names them."""

from __future__ import annotations

import hashlib
import json
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack
from pathlib import Path, PurePosixPath
from typing import IO, Any

from app.formats.csv_text import CsvTableWriter
from app.formats.export_record import ExportRecord, choose_ball_box
from app.formats.frame_names import (
    OTHER,
    folder_name_of_split,
    frame_path_in_split,
    guess_frame_suffix,
)
from app.formats.view_files import PutText, make_disk_writer
from app.json_text import json_text
from app.soccer.frames import Box, ImageSize, box_to_corner_origin, clip_box
from app.soccer.group import View
from app.wording import plural

LISTS = ("train", "val", "test", OTHER)
HELD_OUT = 10
"""Where no split validates, one in so many training images does."""
ENOUGH_MATCHES = 5
"""From so many on, whole matches are held out."""
_PART = "train.part"


class ImageListWriter:
    """Writes the lists image by image.

    The lists name images, wherever they lie: what is held out stays in ``images/train``.

    Attributes:
        used: Lists that have an image, once all is written.
        sentence: What validates, in words, once all is written.
    """

    def __init__(self, root: Path):
        self.used: set[str] = set()
        self.sentence = ""
        self._root = root
        self._matches: Counter[str] = Counter()
        self._groups = 0
        self._newest: tuple[str, str] | None = None

    def __enter__(self) -> ImageListWriter:
        with ExitStack() as stack:
            self._others = {
                name: stack.enter_context(_create_text_file(self._root / f"{name}.txt"))
                for name in LISTS[1:]
            }
            self._waiting = stack.enter_context(_create_text_file(self._root / _PART))
            self._stack = stack.pop_all()
        return self

    def __exit__(self, kind: object, *_: object) -> None:
        self._stack.close()
        if kind is None:
            self._write_lists()

    def add(self, split: str, match: str, group: str, image: str) -> None:
        """One image of one of ``LISTS``."""
        self.used.add(split)
        if split != "train":
            self._others[split].write(f"./{image}\n")
            return
        if (match, group) != self._newest:
            self._newest, self._groups = (match, group), self._groups + 1
        self._matches[match] += 1
        # Which of them train is known once all have been seen.
        self._waiting.write(json_text([match, self._groups, image]) + "\n")

    def _write_lists(self) -> None:
        held_out = self._make_validation_rule()
        part = self._root / _PART
        with (
            part.open(encoding="utf-8") as waiting,
            _create_text_file(self._root / "train.txt") as train,
            (self._root / "val.txt").open("a", encoding="utf-8", newline="\n") as val,
        ):
            for match, group, image in _read_listed_images(waiting):
                (val if held_out(match, group) else train).write(f"./{image}\n")
        part.unlink()
        for name in set(LISTS) - self.used - {"train"}:
            (self._root / f"{name}.txt").unlink()

    def _make_validation_rule(self) -> Callable[[str, int], bool]:
        """Which training images validate, by their match and the number of their group."""
        if "val" in self.used:
            self.sentence = "val.txt holds the validation split."
            return lambda match, group: False
        if self._groups < 2:
            self.sentence = "Too few groups train to hold any out: they validate themselves."
            return lambda match, group: False
        self.used.add("val")
        if len(self._matches) >= ENOUGH_MATCHES:
            self.sentence = (
                "No split validates: val.txt holds whole matches that were meant for training."
            )
            chosen = _choose_validation_matches(self._matches)
            return lambda match, group: match in chosen
        # Neighbours in time look alike: one piece at the end is better than every tenth group.
        last = self._groups - max(round(self._groups / HELD_OUT), 1)
        self.sentence = (
            "No split validates: val.txt holds the last groups that were meant for training, "
            "of matches that train, too."
        )
        return lambda match, group: group > last


def _choose_validation_matches(images: Counter[str]) -> set[str]:
    """About one in ``HELD_OUT`` images by whole matches: the same ones for the same matches."""
    chosen: set[str] = set()
    count = 0
    for match in sorted(images, key=lambda name: hashlib.sha256(name.encode()).digest()):
        chosen.add(match)
        count += images[match]
        if count * HELD_OUT >= images.total():
            break
    return chosen


def _create_text_file(path: Path) -> IO[str]:
    return path.open("w", encoding="utf-8", newline="\n")


def _read_listed_images(file: IO[str]) -> Iterator[tuple[str, int, str]]:
    for line in file:
        match, group, image = json.loads(line)
        yield match, group, image


TABLE = "frames.csv"
_COLUMNS = ("image", "present", "group", "view", "split", "width", "height", "verdict")
# Without a path the lists lie beside this file, wherever that is.
_DATA = """# Ball boxes, one class. {missing}
# {validation}
train: train.txt
val: {val}
{test}nc: 1
names:
  0: ball
"""


def write_yolo(
    root: Path,
    records: Iterable[ExportRecord],
    put: PutText | None = None,
    *,
    boxes: str = "optimized",
    every_view: bool = True,
) -> dict[str, int]:
    """Write labels, lists and ``data.yaml`` below an existing folder.

    A label file that is empty says "no ball here": views that show a ball without a box in their
    picture are left out.
    Boxes are clipped at the image border. Where no split validates, some of what trains is held
    out; what tests never validates. ``frames.csv`` says which image is which view, and
    whether it is there: a frame that was not copied must be put under its name before training.

    Args:
        root: Existing folder.
        records: Groups; one is in memory at a time.
        put: Takes the label files; below ``root`` by default.
        boxes: One of ``BOX_KINDS``.
        every_view: Whether views count from which no detector should learn.

    Returns:
        Counts: ``groups``, ``labels`` (files), ``boxes`` (files with one), ``balls`` (views in
        which the 3D ball holds), ``images``, ``images_missing``, ``views_left_out``.
    """
    names = (
        *("groups", "labels", "boxes", "balls", "images", "images_missing"),
        "views_left_out",
    )
    counts = dict.fromkeys(names, 0)
    put = put or make_disk_writer(root)
    with ExitStack() as stack:
        lists = stack.enter_context(ImageListWriter(root))
        file = stack.enter_context((root / TABLE).open("w", encoding="utf-8", newline=""))
        table = CsvTableWriter(file, _COLUMNS)
        for whole in records:
            record = whole.keep_training_views(boxes, every_view)
            counts["views_left_out"] += len(whole.group.views) - len(record.group.views)
            counts["groups"] += bool(record.group.views)
            for view in record.group.views:
                image = _write_label_file(put, record, view, table, boxes, counts)
                split, group = folder_name_of_split(record.split_of_view(view)), record.group
                lists.add(split, group.match, group.key, image)
    _write_data_yaml(root, lists, counts)
    return counts


def _write_label_file(
    put: PutText,
    record: ExportRecord,
    view: View,
    table: CsvTableWriter,
    boxes: str,
    counts: dict[str, int],
) -> str:
    """Write the label file of a view; returns the name of its image."""
    group, present, split = record.group, view.key in record.frames, record.split_of_view(view)
    image = record.frames.get(view.key) or frame_path_in_split(
        group, view, split, guess_frame_suffix(view)
    )
    label = PurePosixPath("labels", *PurePosixPath(image).parts[1:]).with_suffix(".txt")
    box = choose_ball_box(record, view, boxes)
    line = None if box is None else format_yolo_label(box_to_corner_origin(box), view.size)
    put(str(label), "" if line is None else f"{line}\n")
    cells: tuple[Any, ...] = (image, present, group.key, view.key, split)
    table.add((*cells, view.size.width, view.size.height, record.verdict_text))
    counts["labels"] += 1
    counts["boxes"] += line is not None
    counts["balls"] += record.has_ball_3d(view)
    counts["images" if present else "images_missing"] += 1
    return image


def format_yolo_label(box: Box, size: ImageSize) -> str | None:
    """``0 cx cy w h`` in parts of the image; None where the box lies outside.

    Args:
        box: Measured from the corner of the first pixel, as this format does.
        size: Of the image.

    Example:
        >>> format_yolo_label(Box(192.0, 54.0, 96.0, 54.0), ImageSize(960, 540))
        '0 0.25 0.15 0.1 0.1'
    """
    part = clip_box(box, size)
    if part is None:
        return None
    left, top, right, bottom = part
    numbers = (
        (left + right) / 2 / size.width,
        (top + bottom) / 2 / size.height,
        (right - left) / size.width,
        (bottom - top) / size.height,
    )
    return "0 " + " ".join(f"{number:.9g}" for number in numbers)


def _write_data_yaml(root: Path, lists: ImageListWriter, counts: dict[str, int]) -> None:
    missing = counts["images_missing"]
    sentence = (
        f"{plural(missing, 'image is', 'images are')} not in this export: put each where {TABLE} names it."
        if missing
        else "All images are in this export."
    )
    val = "val.txt" if "val" in lists.used else "train.txt"
    test = "test: test.txt\n" if "test" in lists.used else ""
    validation = lists.sentence
    if OTHER in lists.used:
        validation += (
            f"\n# {OTHER}.txt holds the images of splits that neither train nor validate nor test."
        )
    text = _DATA.format(missing=sentence, validation=validation, val=val, test=test)
    (root / "data.yaml").write_text(text, encoding="utf-8")
