"""YOLO: ``train.txt``, ``val.txt`` and ``test.txt``, with a validation that is never the test."""

from __future__ import annotations

import hashlib
import json
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import IO

from app.finite import json_text

LISTS = ("train", "val", "test")
HELD_OUT = 10
"""Where no split validates, one in so many training images does."""
ENOUGH_MATCHES = 5
"""From so many on, whole matches are held out."""
_PART = "train.part"


class ImageLists:
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

    def __enter__(self) -> ImageLists:
        with ExitStack() as stack:
            self._others = {
                name: stack.enter_context(_create(self._root / f"{name}.txt")) for name in LISTS[1:]
            }
            self._waiting = stack.enter_context(_create(self._root / _PART))
            self._stack = stack.pop_all()
        return self

    def __exit__(self, kind: object, *_: object) -> None:
        self._stack.close()
        if kind is None:
            self._finish()

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

    def _finish(self) -> None:
        held_out = self._held_out()
        part = self._root / _PART
        with (
            part.open(encoding="utf-8") as waiting,
            _create(self._root / "train.txt") as train,
            (self._root / "val.txt").open("a", encoding="utf-8", newline="\n") as val,
        ):
            for match, group, image in _rows(waiting):
                (val if held_out(match, group) else train).write(f"./{image}\n")
        part.unlink()
        for name in set(LISTS) - self.used - {"train"}:
            (self._root / f"{name}.txt").unlink()

    def _held_out(self) -> Callable[[str, int], bool]:
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
            chosen = _some_matches(self._matches)
            return lambda match, group: match in chosen
        # Neighbours in time look alike: one piece at the end is better than every tenth group.
        last = self._groups - max(round(self._groups / HELD_OUT), 1)
        self.sentence = (
            "No split validates: val.txt holds the last groups that were meant for training, "
            "of matches that train, too."
        )
        return lambda match, group: group > last


def _some_matches(images: Counter[str]) -> set[str]:
    """About one in ``HELD_OUT`` images by whole matches: the same ones for the same matches."""
    chosen: set[str] = set()
    count = 0
    for match in sorted(images, key=lambda name: hashlib.sha256(name.encode()).digest()):
        chosen.add(match)
        count += images[match]
        if count * HELD_OUT >= images.total():
            break
    return chosen


def _create(path: Path) -> IO[str]:
    return path.open("w", encoding="utf-8", newline="\n")


def _rows(file: IO[str]) -> Iterator[tuple[str, int, str]]:
    for line in file:
        match, group, image = json.loads(line)
        yield match, group, image
