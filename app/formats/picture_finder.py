"""Finds the pictures of a dataset by their names, and what folders say of splits."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import PurePosixPath
from urllib.parse import unquote

from app.formats.frame_names import IMAGE_SUFFIXES
from app.formats.split_names import parse_split_name

_LOCAL = re.compile(r"^.{0,2000}?[?&]d=", re.DOTALL)
"""Label Studio's own address of a file on its disk: ``/data/local-files/?d=images/1.jpg``."""
_SCHEME = re.compile(r"([A-Za-z][A-Za-z0-9+.-]{1,20})://([^/\\]*)")
_DRIVE = re.compile(r"[A-Za-z]:(?=[/\\]|$)")


def split_picture_name(name: str) -> tuple[str, ...]:
    """Folders and file of a picture's name, in composed letters, without what no folder here has.

    Drives, roots, ``.``, ``..``, hosts and what follows a ``?`` of an address are left out.

    Example:
        >>> split_picture_name("..\\\\..\\\\media\\\\4\\\\north.jpg"), split_picture_name("file:///C:/a%20b/1.jpg")
        (('media', '4', 'north.jpg'), ('a b', '1.jpg'))
    """
    text = name.strip()
    if local := _LOCAL.match(text):
        text = unquote(text[local.end() :].partition("&")[0])
    elif scheme := _SCHEME.match(text):
        text = text[scheme.end() :]
        text = unquote(text if scheme[1].lower() == "file" else re.split("[?#]", text)[0])
    text = unicodedata.normalize("NFC", text.replace("\\", "/"))
    drive = _DRIVE.match(text.lstrip("/"))
    if drive is not None:
        text = text.lstrip("/")[drive.end() :]
    return tuple(part for part in text.split("/") if part not in ("", ".", ".."))


_WORDS = re.compile(r"[^a-z0-9]+")


def find_split_in_word(name: str) -> str:
    """The split that one word of a name says; empty where none does, or two contradict.

    Example:
        >>> find_split_in_word("instances_train2017"), find_split_in_word("train_or_test"), find_split_in_word("_annotations.coco")
        ('train', '', '')
    """
    found = {split for word in _WORDS.split(name.lower()) if (split := parse_split_name(word))}
    return found.pop() if len(found) == 1 else ""


LABEL_FOLDERS = frozenset({"annotations", "annotation", "labels", "coco", "json"})
"""Folders of labels: the pictures lie beside them, not in them."""
PICTURE_FOLDERS = ("images", "data", "img", "frames")
Name = tuple[str, ...]
"""Of a picture, as ``split_picture_name`` gives it."""
_MAX_RIVALS = 500
"""Pictures of one name that are compared."""


@dataclass(frozen=True)
class LabelLocation:
    """Where a file of labels lies, and which of several sets it is about.

    Attributes:
        folder: Its folder; ``""`` for the top, else without a slash at its end.
        subset: ``Train`` of ``instances_Train.json``; empty where the name says none.
        split: The split that it is of, or empty.
        strange: Subsets and folders of other files, in lower case: their pictures are not its own.
        elsewhere: Folders in which other files have theirs.
    """

    folder: str
    subset: str = ""
    split: str = ""
    strange: Collection[str] = ()
    elsewhere: Collection[str] = ()

    @property
    def root(self) -> str:
        """The folder that has labels and pictures."""
        place = PurePosixPath(self.folder)
        inside = place.name.lower() in LABEL_FOLDERS
        return _format_path(place.parent if inside else place)

    def list_picture_folders(self) -> Iterable[str]:
        """Folders in which tools put the pictures of such a file, the likeliest first."""
        tops = list(dict.fromkeys((self.folder, self.root)))
        tops += [top for top in ("",) if top not in tops]
        if self.subset:
            for top in tops:
                yield from (_join_path(top, inner, self.subset) for inner in (*PICTURE_FOLDERS, ""))
                yield _join_path(top, self.subset, "images")
        for top in tops:
            yield top
            yield from (_join_path(top, inner) for inner in PICTURE_FOLDERS)
            yield _join_path(top, "images", "default")

    def can_picture_belong(self, place: str, wanted: Collection[str]) -> bool:
        """Whether a picture can be one of this file's, for all that its folders say."""
        own = {part.lower() for part in (*PurePosixPath(self.folder).parts, *wanted)}
        if any(_is_below_folder(place, other) for other in self.elsewhere):
            return False
        for part in PurePosixPath(place).parts[:-1]:
            if part.lower() in own:
                continue
            split = parse_split_name(part)
            if part.lower() in self.strange or (self.split and split and split != self.split):
                return False
        return True


@dataclass(frozen=True)
class PictureSearchResult:
    """What a search came to.

    Attributes:
        place: The picture's name in its tree; None where there is none, or no single one.
        parts: How many parts of the name it has at its end.
        rivals: Pictures that fit equally well, where there are several.
        folded: Whether it fits in another case alone.
    """

    place: str | None = None
    parts: int = 0
    rivals: tuple[str, ...] = ()
    folded: bool = False


@dataclass
class PictureFinder:
    """The pictures among the files of a tree, by name.

    Letters are compared composed (macOS decomposes them); where no name fits, case is ignored.
    """

    names: Iterable[str]
    _places: dict[str, str] = field(default_factory=dict, init=False)
    _by_end: dict[str, list[str]] = field(default_factory=dict, init=False)

    def __post_init__(self) -> None:
        for name in self.names:
            place = PurePosixPath(name)
            if place.suffix.lower() not in IMAGE_SUFFIXES:
                continue
            composed = unicodedata.normalize("NFC", name)
            self._places.setdefault(composed, name)
            for end in {"/".join(composed.split("/")[-count:]) for count in (1, 2)}:
                self._by_end.setdefault(end, []).append(name)
                self._by_end.setdefault(f"?{end.casefold()}", []).append(name)

    @property
    def has_pictures(self) -> bool:
        """Whether there are pictures at all."""
        return bool(self._places)

    def find_picture(self, parts: Name, home: LabelLocation) -> PictureSearchResult:
        """The picture of a name.

        Args:
            parts: As ``split_picture_name`` gives them.
            home: Of the file that names it.
        """
        if not parts:
            return PictureSearchResult()
        name = "/".join(parts)
        for folder in home.list_picture_folders():
            place = self._places.get(_join_path(folder, name))
            if place is not None and home.can_picture_belong(place, parts):
                return PictureSearchResult(place, len(parts))
        for fold in (False, True):
            found = self._find_by_longest_common_end(parts, home, fold)
            if found.place is not None or found.rivals:
                return found
        return PictureSearchResult()

    def _find_by_longest_common_end(
        self, parts: Name, home: LabelLocation, fold: bool
    ) -> PictureSearchResult:
        """The picture with the longest common end, in the file's own folders before others."""
        places: list[str] = []
        for count in (2, 1):
            end = "/".join(parts[-count:])
            places = self._by_end.get(f"?{end.casefold()}" if fold else end, [])
            if places and len(parts) >= count:
                break
        if len(places) > _MAX_RIVALS:
            return PictureSearchResult(rivals=tuple(places[:3]))
        fitting = [place for place in places if home.can_picture_belong(place, parts)]
        ranks: dict[tuple[int, bool, bool], list[str]] = {}
        for place in fitting:
            rank = (
                _count_common_trailing_parts(parts, place, fold),
                bool(home.folder) and _is_below_folder(place, home.folder),
                bool(home.root) and _is_below_folder(place, home.root),
            )
            ranks.setdefault(rank, []).append(place)
        if not ranks:
            return PictureSearchResult()
        best = max(ranks)
        if len(ranks[best]) > 1:
            return PictureSearchResult(rivals=tuple(ranks[best][:3]))
        return PictureSearchResult(ranks[best][0], best[0], folded=fold)


def drop_contested_pictures(
    found: Mapping[Name, PictureSearchResult],
) -> dict[Name, PictureSearchResult]:
    """What was found for each name, without pictures that fit another name better or as well.

    Two pictures of a file are two pictures: ``clip1/1.jpg`` is not ``clip2/1.jpg``, where that
    alone is there. A name in the picture's own case fits better than one in another.
    """
    claims: dict[str, list[Name]] = {}
    for name, item in found.items():
        if item.place is not None:
            claims.setdefault(item.place, []).append(name)
    own = dict(found)
    for place, names in claims.items():
        ranks = {name: (not found[name].folded, found[name].parts) for name in names}
        highest = max(ranks.values())
        best = [name for name in names if ranks[name] == highest]
        for name in names:
            if len(names) > 1 and (len(best) > 1 or name not in best):
                own[name] = PictureSearchResult(rivals=(place,))
    return own


def _count_common_trailing_parts(parts: Name, place: str, fold: bool) -> int:
    others = unicodedata.normalize("NFC", place).split("/")
    count = 0
    for one, other in zip(reversed(parts), reversed(others), strict=False):
        if one != other and not (fold and one.casefold() == other.casefold()):
            break
        count += 1
    return count


def _is_below_folder(place: str, folder: str) -> bool:
    return not folder or place.startswith(f"{folder}/")


def _join_path(*parts: str) -> str:
    return "/".join(part for part in parts if part)


def _format_path(place: PurePosixPath) -> str:
    return "" if str(place) == "." else str(place)
