"""Names of an export: a file belongs to one frame, however alike the views of groups are named."""

from __future__ import annotations

import hashlib
import unicodedata
from collections.abc import Callable, Hashable, Iterable, Iterator, Mapping
from dataclasses import replace

from app.errors import InputError
from app.formats.frame_names import expected_frame_suffix, frame_path_by_match, view_stem
from app.soccer.annotation import Extras
from app.soccer.group import Group, View

Outline = tuple[Group, Mapping[str, str]]
"""A group whose views need no lines and no balls, and the split of views that have their own."""
Claims = Callable[[Group, View, str], Mapping[str, Hashable]]
"""The names that a view would have in an export, from its group and split; whose each would be."""


def fold_file_name(name: str) -> str:
    """The same for names that a disk may take for one: they differ in case or composition only."""
    return unicodedata.normalize("NFC", name).casefold()


def with_export_key(view: View, name: str | None) -> View:
    """The view with the key that names its files; its own where ``name`` is None."""
    # What a source said of the frame's name counts no more.
    return view if name is None else replace(view, key=name, extras=Extras())


def frame_identity(group: Group, view: View) -> Hashable:
    """Which frame a view shows: the file where there is one, which several groups may show."""
    if view.media is None:
        return group.key, view.key
    return view.media, view.station.flipped


def frame_name_claims(group: Group, view: View, split: str) -> Mapping[str, Hashable]:
    """Of formats whose records name the picture alone."""
    return {
        frame_path_by_match(group, view, split, expected_frame_suffix(view)): frame_identity(
            group, view
        )
    }


def key_in_group(group: Group, view: View, glue: str = "/") -> str:
    """The key of a view with the name of its group before it, ``kick-1/north``."""
    own = group.key.removeprefix(f"{group.match}/") if group.match else group.key
    key = view.key if view.key == group.key else f"{own}/{view.key}"
    return key.replace("/", glue)


class ExportNames:
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
                for name, owner in self._hash_claims(group, view, splits):
                    if self._owners.setdefault(name, owner) != owner:
                        self._contested.add(name)

    def of(self, group: Group, splits: Mapping[str, str]) -> dict[str, str]:
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
        for key in self._candidate_keys(group, view):
            other = None if key == view.key else key
            names = self._hash_claims(group, view, splits, other)
            if all(
                name not in self._contested and self._owners.get(name, owner) == owner
                for name, owner in names
            ):
                self._owners.update(names)
                return key
        raise InputError(
            f"the view {view.key} of group {group.key} has no name of its own in the export",
            hint="Rename the view or its group in the source, and import it again.",
        )

    def _candidate_keys(self, group: Group, view: View) -> Iterator[str]:
        yield view.key
        yield key_in_group(group, view, self._glue)
        stem = view_stem(view.key)
        ending = view.key.removeprefix(stem)
        digest = hashlib.sha256(f"{group.key}\0{view.key}".encode()).hexdigest()[:12]
        yield f"{stem.replace('/', self._glue)}_{digest}{ending}"

    def _hash_claims(
        self, group: Group, view: View, splits: Mapping[str, str], key: str | None = None
    ) -> list[tuple[int, int]]:
        split = splits.get(view.key, group.split)
        wanted = self._claims(group, with_export_key(view, key), split)
        return [(hash(fold_file_name(name)), hash(owner)) for name, owner in wanted.items()]
