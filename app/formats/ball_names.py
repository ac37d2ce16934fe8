"""Names under which tools and people keep the ball, and the categories of COCO files."""

from __future__ import annotations

import re
import unicodedata
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from app.formats.fields import IdIndex, id_to_text
from app.formats.report import ReaderReport
from app.wording import plural

_WORD = re.compile(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+|[^\W\d_A-Za-z]+")
_BALLS = frozenset(
    {"ball", "fussball", "voetbal", "ballon", "balon", "pelota", "bola", "pallone", "pilka"}
    | {"мяч", "足球", "ボール", "サッカーボール", "공", "축구공"}
)
_OF_SOCCER = frozenset(
    {"sport", "soccer", "foot", "game", "match", "play", "the", "object", "futbol", "futebol"}
)
"""Words that may stand beside it; any other makes it another ball (basket, hand) or no ball (boy)."""


def is_ball_name(name: str) -> bool:
    """Whether a name means the ball of a football match, whatever its case, separators and digits.

    Example:
        >>> [is_ball_name(name) for name in ("Sports_Ball", "soccer-balls", "ball_1", "basketball")]
        [True, True, True, False]
    """
    words = [
        word
        for part in _WORD.findall(strip_accents(name))
        for word in _split_compound_word(part.lower())
    ]
    return any(word in _BALLS for word in words) and all(
        word in _BALLS or word in _OF_SOCCER for word in words
    )


def is_same_name(one: str, other: str) -> bool:
    """Whether two names differ in case, separators and accents alone."""
    return _keep_letters_and_digits(one) == _keep_letters_and_digits(other)


def strip_accents(name: str) -> str:
    """A name without accents and in the usual form of each letter."""
    letters = unicodedata.normalize("NFKD", name[:200].replace("ß", "ss"))
    kept = "".join(letter for letter in letters if not unicodedata.combining(letter))
    return unicodedata.normalize("NFKC", kept)


def _keep_letters_and_digits(name: str) -> str:
    return re.sub(r"[\W_]+", "", strip_accents(name)).casefold()


def _split_compound_word(word: str) -> list[str]:
    """The words that a compound is of, each in the singular: ``footballs`` is foot and ball."""
    for whole in (word, word.removesuffix("s")):
        if whole in _BALLS or whole in _OF_SOCCER:
            return [whole]
        if whole.endswith("ball"):
            return [*_split_compound_word(whole.removesuffix("ball")), "ball"]
    return [word]


STATE = "touchline"
"""The extra field of an image that holds everything that was said of its view."""
CAMERA = "camera"
"""The field of an image that holds its camera as SoccerNet spells it."""
ORIGIN, CORNER = "bbox_origin", "corner"
"""Says in that block, and in the file's ``info``, that boxes are measured from the corner of the
first pixel; files of before, whose boxes are in our own pixel frame, do not say it."""
PREFIX, OUTSIDE = "instances_", "outside_"
"""Of the files with the images from which a detector learns, and of those with all others."""


_SHOWN = 12
"""Categories that a sentence names."""
HOW = "if one of them is the ball, name it (Category of the ball, --ball-category)"


@dataclass(frozen=True)
class CocoCategory:
    """One category; a file that lists none has one without a name for each id."""

    id: str
    name: str
    keypoints: tuple[str, ...] = ()
    ball: bool = False

    @property
    def shown(self) -> str:
        """What a sentence calls it."""
        return f'"{self.name[:60]}"' if self.name else f"id {self.id[:40]}"


class CocoCategories:
    """The categories of one file.

    Args:
        listed: The list ``categories``; empty where the file has none.
        annotations: All annotations; which ids they use decides where no category is listed.
        path: The file, for problems.
        report: Takes what is wrong with the list.
        ball: Name or id of the category that somebody says is the ball; empty: by the names.
    """

    def __init__(
        self,
        listed: Sequence[Any],
        annotations: Sequence[Any],
        path: str,
        report: ReaderReport,
        ball: str = "",
    ):
        self._path, self._report, self._named = path, report, ball
        self._index: IdIndex[CocoCategory] = IdIndex()
        self._all: list[CocoCategory] = []
        self._found: Counter[str] = Counter()
        self.listed = bool(listed)
        found = (
            self._read_listed_categories(listed)
            if listed
            else self._make_categories_from_ids(annotations)
        )
        for value, category in found:
            if self._index.add(value, category):
                self._all.append(category)
            else:
                report.add_problem_at(
                    path, f"category {category.shown}", "id", "is listed twice; left out"
                )

    def find(self, value: Any) -> CocoCategory | None:
        """The category of an annotation's ``category_id``; some tools write its name there."""
        found = self._index.find(value)
        if found is None and isinstance(value, str):
            named = [item for item in self._all if item.name and is_same_name(item.name, value)]
            return named[0] if len(named) == 1 else None
        return found

    def count_ball(self, category: CocoCategory) -> None:
        """Note a ball that was read."""
        self._found[category.id] += 1

    @property
    def ball_count(self) -> int:
        """How many balls were read."""
        return sum(self._found.values())

    def report_ball_category(self, *, alone: bool) -> None:
        """Say which category was taken for the ball; where none brought one it is a problem.

        Args:
            alone: Whether no other file brought a ball either.
        """
        taken = [category for category in self._all if category.ball]
        if self.ball_count:
            names = " and ".join(item.shown for item in taken if self._found[item.id])
            count = plural(self.ball_count, "annotation")
            why = "" if self.listed else "; the file lists no categories"
            self._report.add_remark(f"{self._path}: category {names} is the ball ({count}){why}")
            return
        if taken:
            names = " or ".join(item.shown for item in taken[:_SHOWN])
            sentence = f"the file contains no ball: no annotation that can be read has {names}"
        elif not self._all:
            sentence = "the file contains no ball: it has no categories"
        else:
            names = ", ".join(item.shown for item in self._all[:_SHOWN])
            more = len(self._all) - _SHOWN
            names += f" and {more} more" if more > 0 else ""
            sentence = f"the file contains no ball: none of its categories ({names}) is recognised as the ball"
            sentence += f"; {HOW}"
        if alone:
            self._report.add_problem_at(self._path, None, "categories", sentence)
        else:
            self._report.add_remark(f"{self._path}: {sentence}")

    def _read_listed_categories(self, listed: Sequence[Any]) -> Iterable[tuple[Any, CocoCategory]]:
        for index, item in enumerate(listed):
            record = f"categories[{index}]"
            if not isinstance(item, dict) or id_to_text(item.get("id")) is None:
                self._report.add_problem_at(
                    self._path, record, "id", "must be a number or a text; this entry is left out"
                )
                continue
            name = item.get("name")
            if not isinstance(name, str) or not name.strip():
                self._report.add_problem_at(self._path, record, "name", "is missing or no text")
                name = ""
            yield item["id"], self._make_category(item["id"], name.strip(), item)

    def _make_category(self, value: Any, name: str, item: Mapping[str, Any]) -> CocoCategory:
        text = id_to_text(value) or ""
        points = item.get("keypoints")
        keypoints = tuple(map(str, points)) if isinstance(points, list) else ()
        return CocoCategory(text, name, keypoints, self._is_ball(text, name))

    def _is_ball(self, text: str, name: str) -> bool:
        if self._named:
            return id_to_text(self._named) == text or (
                bool(name) and is_same_name(name, self._named)
            )
        return is_ball_name(name)

    def _make_categories_from_ids(
        self, annotations: Sequence[Any]
    ) -> Iterable[tuple[Any, CocoCategory]]:
        """A category for each id; the only one is the ball where no picture has two of it."""
        images: dict[str, Counter[str]] = {}
        for item in annotations:
            text = id_to_text(item.get("category_id")) if isinstance(item, dict) else None
            if text is not None:
                images.setdefault(text, Counter())[id_to_text(item.get("image_id")) or ""] += 1
        for text, counts in images.items():
            only = len(images) == 1 and max(counts.values()) == 1
            named = id_to_text(self._named) == text if self._named else only
            yield text, CocoCategory(text, "", (), named)
