"""Split: which groups and views of a version train, and which test.

As the dataset gives it; by match, drawn with a seed; or by camera, as ISSIA's authors did it.
"""

from __future__ import annotations

import hashlib
from collections.abc import Collection, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any, get_args

from app.errors import InputError
from app.soccer.choices import SplitKind

KINDS: tuple[str, ...] = get_args(SplitKind)
TRAIN, TEST = "train", "test"
TEST_CAMERAS = ("cam1", "cam2")
"""ISSIA's: cameras 3 to 6 train, 1 and 2 test."""


@dataclass(frozen=True)
class Split:
    """How a version is split.

    Attributes:
        kind: One of ``KINDS``.
        seed: Of the draw by match.
        test_share: Share of the dataset's matches that test, in the draw by match.
        test_cameras: Keys of the views that test, in the split by camera.
    """

    kind: str = "given"
    seed: int = 0
    test_share: float = 0.2
    test_cameras: tuple[str, ...] = TEST_CAMERAS

    def check(self) -> None:
        """Raise InputError where it says something impossible."""
        if self.kind not in KINDS:
            raise InputError(
                f'"{self.kind}" is not a kind of split; kinds are {", ".join(KINDS)}',
                pointer="/split/kind",
            )
        if not 0 < self.test_share < 1:
            raise InputError("test_share must lie between 0 and 1", pointer="/split/test_share")
        if self.kind == "camera" and not self.test_cameras:
            raise InputError(
                "a split by camera needs at least one test camera", pointer="/split/test_cameras"
            )

    def to_plain_values(self) -> dict[str, Any]:
        """What of it counts, as plain values."""
        values = asdict(self)
        wanted = {
            "given": ("kind",),
            "match": ("kind", "seed", "test_share"),
            "camera": ("kind", "test_cameras"),
        }
        chosen = {name: values[name] for name in wanted[self.kind]}
        if "test_cameras" in chosen:
            chosen["test_cameras"] = sorted(self.test_cameras)
        return chosen

    @staticmethod
    def of(values: Mapping[str, Any]) -> Split:
        """Back from ``values``."""
        cameras = tuple(values.get("test_cameras", TEST_CAMERAS))
        return Split(**{**values, "test_cameras": cameras})


@dataclass(frozen=True)
class Splitter:
    """A split applied to the groups of one dataset; ``tests`` are the matches that test."""

    split: Split
    tests: frozenset[str] = frozenset()

    @staticmethod
    def of(split: Split, matches: Collection[str]) -> Splitter:
        """A splitter for a dataset of these matches, all of them, in a version or not.

        All of them, so that a match does not change sides while its groups are reviewed.

        Raises:
            InputError: A draw by match with fewer than two matches.
        """
        split.check()
        if split.kind != "match":
            return Splitter(split)
        return Splitter(split, _draw_test_matches(split, set(matches)))

    def split_of_group(self, match: str, given: str, views: Sequence[str]) -> str:
        """Split of a group; empty where its views are on both sides."""
        if self.split.kind == "given":
            return given
        if self.split.kind == "match":
            return TEST if match in self.tests else TRAIN
        sides = {self._split_of_view(view) for view in views}
        return sides.pop() if len(sides) == 1 else ""

    def splits_by_view(self, views: Sequence[str]) -> dict[str, str] | None:
        """Split by view; None where all views go with their group."""
        if self.split.kind != "camera" or len({self._split_of_view(view) for view in views}) == 1:
            return None
        return {view: self._split_of_view(view) for view in views}

    def _split_of_view(self, view: str) -> str:
        return TEST if view in self.split.test_cameras else TRAIN


def _draw_test_matches(split: Split, matches: set[str]) -> frozenset[str]:
    """The matches that test: those whose digests with the seed are the smallest."""
    if len(matches) < 2:
        raise InputError(
            "a split by match needs at least two matches",
            hint="Use the split that came with the data (given).",
        )
    count = min(max(1, round(split.test_share * len(matches))), len(matches) - 1)
    ranked = sorted(matches, key=lambda match: (_digest_with_seed(split.seed, match), match))
    return frozenset(ranked[:count])


def _digest_with_seed(seed: int, match: str) -> str:
    return hashlib.sha256(f"{seed}:{match}".encode()).hexdigest()
