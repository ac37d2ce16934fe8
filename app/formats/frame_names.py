"""Names of frames and files in an export: a file belongs to one frame, however alike views are named."""

from __future__ import annotations

import hashlib
import re
import unicodedata
from collections.abc import Callable, Hashable, Iterable, Mapping
from dataclasses import replace
from pathlib import PurePosixPath

from app.errors import InputError
from app.formats.split_names import parse_split_name
from app.object_store.path import split_pinned_address
from app.soccer.annotation import Extras
from app.soccer.group import Group, View

IMAGE_SUFFIXES = (".jpg", ".jpeg", ".jfif", ".png", ".webp")
VIDEO_SUFFIXES = (
    *(".mp4", ".avi", ".mpg", ".mpeg", ".mkv", ".mov"),
    *(".m4v", ".ts", ".mts", ".m2ts", ".webm", ".wmv", ".flv", ".ogv", ".3gp"),
)
FOLDER = "Frames-v3"
"""Beside the labels of a match, where SoccerNet's readers look for loose frames."""
OTHER = "other"
"""Folder of splits that neither train nor validate nor test."""
_UNSAFE = re.compile(r"[^A-Za-z0-9._-]+")


def is_system_file(name: str) -> bool:
    """Whether an operating system laid a file beside those of people, as ``Thumbs.db``."""
    place = PurePosixPath(name)
    hidden = any(part.startswith(".") or part == "__MACOSX" for part in place.parts)
    return hidden or place.name.lower() in ("thumbs.db", "desktop.ini")


FrameName = Callable[[Group, View, str, str], str]
"""Place of a frame in an export, from its group, its view, its split and the ending to give."""


def frame_path_by_match(group: Group, view: View, split: str, suffix: str) -> str:
    """``<match>/Frames-v3/7_1.png``; static cameras: ``.../cam3/358.jpg``.

    The ending of a view's key stays, whatever the frame is: labels and readers go by the name.
    """
    name = PurePosixPath(view.key)
    match = group.match or "frames"
    if view.station.shared:
        return f"{match}/{FOLDER}/{view.key}/{group.key}{suffix}"
    if name.suffix.lower() in IMAGE_SUFFIXES:
        return f"{match}/{FOLDER}/{name}"
    return f"{match}/{FOLDER}/{name}{suffix}"


def frame_path_in_split(group: Group, view: View, split: str, suffix: str) -> str:
    """``images/<split>/<digest of the group>_<view>.jpg``: no name of ours meets another.

    Labels have the name without its ending: views that would share it have a digest of theirs, too.
    """
    ending = PurePosixPath(view.key).suffix.lower()
    stem = _make_file_safe_stem(view.key)
    same = sum(_make_file_safe_stem(other.key).lower() == stem.lower() for other in group.views)
    ending = ending if ending in IMAGE_SUFFIXES else suffix
    name = list_frame_stems_in_split(group, view)[same > 1]
    return f"images/{folder_name_of_split(split)}/{name}{ending}"


def list_frame_stems_in_split(group: Group, view: View) -> tuple[str, str]:
    """The names that ``frame_path_in_split`` may give: without and with a digest of the view."""
    stem = f"{_key_digest(group.key)}_{_make_file_safe_stem(view.key)}"
    return stem, f"{stem}_{_key_digest(view.key)}"


def _make_file_safe_stem(key: str) -> str:
    return _UNSAFE.sub("-", strip_image_suffix(key))


def _key_digest(key: str) -> str:
    return hashlib.sha256(key.encode()).hexdigest()[:12]


def folder_name_of_split(split: str) -> str:
    """Name of a split as a folder: YOLO says ``val``, and what has no split trains.

    A split that is called otherwise, such as ``fold-3``, may be held out: it does not train.
    """
    if not split.strip():
        return "train"
    folders = {"train": "train", "valid": "val", "test": "test", "challenge": "test"}
    return folders.get(parse_split_name(split), OTHER)


def guess_frame_suffix(view: View) -> str:
    """Ending that a copy of a view's frame would most likely have."""
    media = view.media
    name = "" if media is None else media.member or split_pinned_address(media.path)[0]
    suffix = PurePosixPath(name).suffix.lower()
    return suffix if suffix in IMAGE_SUFFIXES else ".jpg"


def strip_image_suffix(key: str) -> str:
    """Key of a view without the ending of an image's name."""
    place = PurePosixPath(key)
    return str(place.with_suffix("")) if place.suffix.lower() in IMAGE_SUFFIXES else key


def view_file_path(group: Group, view: View) -> str:
    """Where the files of a view go, without prefix and ending: ``<match>/7_1``."""
    # The key of a frame that is a group alone is the place of its file.
    match = group.match if view.key != group.key else ""
    return str(PurePosixPath(match) / strip_image_suffix(view.key))


_HOLDER = re.compile(
    r"(labels?|lines?|images?|imgs?|frames?|frames-v3|pred(?:iction)?s?|predict|results?"
    r"|detect(?:ion)?s?|out(?:put)?s?|runs?|exp|train(?:ing)?|val(?:id|idation)?|test|challenge"
    r"|unassigned|data(?:sets?)?|coco|yolo|csv|txt|json|box(?:es)?|balls?|careful|cameras?"
    r"|calib(?:ration)?s?|\.)(?:[-_ ]?([0-9]+)|-[0-9]+x[0-9]+|[-_])?",
    re.IGNORECASE | re.ASCII,
)


class HolderFolders:
    """Tells folders that hold files of any group or match, as ``labels`` and ``predict2``.

    Every other folder may be the name of one. So may "frame_99" where a group is called "frame_7".

    Args:
        names: Of the groups and matches of a dataset.
    """

    def __init__(self, names: Iterable[str] = ()):
        found = (_HOLDER.fullmatch(part) for name in names for part in name.split("/"))
        self._series = {match[1].lower() for match in found if match and match[2]}

    def find_other_folders(self, folders: Iterable[str]) -> list[str]:
        """The folders that may name a group or a match."""
        return [folder for folder in folders if not self._holds_any(folder)]

    def _holds_any(self, folder: str) -> bool:
        found = _HOLDER.fullmatch(folder)
        return found is not None and not (found[2] and found[1].lower() in self._series)


Outline = tuple[Group, Mapping[str, str]]
"""A group whose views need no lines and no balls, and the split of views that have their own."""
Claims = Callable[[Group, View, str], Mapping[str, Hashable]]
"""The names that a view would have in an export, from its group and split; whose each would be."""


def compose_name(name: str) -> str:
    """A name with each accent in its letter: macOS writes folders with accents of their own."""
    return unicodedata.normalize("NFC", name)


def normalize_file_name(name: str) -> str:
    """The same for names that a disk may take for one: they differ in case or composition only."""
    return unicodedata.normalize("NFC", name).casefold()


def with_export_key(view: View, name: str | None) -> View:
    """The view with the key that names its files; its own where ``name`` is None."""
    # What a source said of the frame's name counts no more.
    return view if name is None else replace(view, key=name, extras=Extras())


def identify_frame(group: Group, view: View) -> Hashable:
    """Which frame a view shows: the file where there is one, which several groups may show."""
    if view.media is None:
        return group.key, view.key
    return view.media, view.station.flipped


def map_frame_names_to_owners(group: Group, view: View, split: str) -> Mapping[str, Hashable]:
    """Of formats whose records name the picture alone."""
    return {
        frame_path_by_match(group, view, split, guess_frame_suffix(view)): identify_frame(
            group, view
        )
    }


def prefix_view_key_with_group(group: Group, view: View, glue: str = "/") -> str:
    """The key of a view with the name of its group before it, ``kick-1/north``."""
    own = group.key.removeprefix(f"{group.match}/") if group.match else group.key
    key = view.key if view.key == group.key else f"{own}/{view.key}"
    return key.replace("/", glue)


def list_possible_export_keys(group: Group, view: View, glue: str = "/") -> tuple[str, ...]:
    """The keys by which an export may call the files of a view: the first that no other frame has."""
    stem = strip_image_suffix(view.key)
    ending = view.key.removeprefix(stem)
    digest = hashlib.sha256(f"{group.key}\0{view.key}".encode()).hexdigest()[:12]
    return (
        view.key,
        prefix_view_key_with_group(group, view, glue),
        f"{stem.replace('/', glue)}_{digest}{ending}",
    )


class ExportKeyAssigner:
    """Gives each view of an export the key by which its files are called.

    That is its own key, unless several frames would then have one name: each of them has the name
    of its group before it, ``kick-1/north``. Which name a frame has depends on what is exported,
    not on the order.

    Args:
        claims: The names that the format makes.
        outlines: Everything that will be exported.
        glue: Between group and view; formats that lay frames flat take ``_``.
    """

    def __init__(self, claims: Claims, outlines: Iterable[Outline] = (), glue: str = "/"):
        self._claims, self._glue = claims, glue
        # Hashes, as there are as many as frames; two that meet cost a longer name.
        self._owners: dict[int, int] = {}
        self._contested: set[int] = set()
        for group, splits in outlines:
            for view in group.views:
                for name, owner in self._hash_names_and_owners(group, view, splits):
                    if self._owners.setdefault(name, owner) != owner:
                        self._contested.add(name)

    def assign_keys(self, group: Group, splits: Mapping[str, str]) -> dict[str, str]:
        """The keys of views that are called by another one than their own, by their own.

        Raises:
            InputError: Every name of a view belongs to another frame.
        """
        found: dict[str, str] = {}
        for view in group.views:
            key = self._choose_free_key(group, view, splits)
            if key != view.key:
                found[view.key] = key
        return found

    def _choose_free_key(self, group: Group, view: View, splits: Mapping[str, str]) -> str:
        for key in list_possible_export_keys(group, view, self._glue):
            other = None if key == view.key else key
            names = self._hash_names_and_owners(group, view, splits, other)
            if all(
                name not in self._contested and self._owners.get(name, owner) == owner
                for name, owner in names
            ):
                self._owners.update(names)
                return key
        raise InputError(
            f"view {view.key} of group {group.key} and another view would have the same name"
            " in the export",
            hint="Rename the view or its group in the source, and import it again.",
        )

    def _hash_names_and_owners(
        self, group: Group, view: View, splits: Mapping[str, str], key: str | None = None
    ) -> list[tuple[int, int]]:
        split = splits.get(view.key, group.split)
        wanted = self._claims(group, with_export_key(view, key), split)
        return [(hash(normalize_file_name(name)), hash(owner)) for name, owner in wanted.items()]
