"""Frame names: from how a file of predictions calls a frame to the frame of the dataset."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field

from app.datasets.frame_names import flat_frame, match_frame
from app.soccer.frames import ImageSize
from app.soccer.group import Group, Station, View

_SUFFIX = re.compile(r"\.(png|jpe?g|webp|bmp|txt|json)$", re.IGNORECASE | re.ASCII)
_MATCH = " - "
"""Stands in the name of every SoccerNet match."""
_SEVERAL = -1
"""Stands in the index for a name that fits several frames."""


@dataclass(frozen=True)
class NamedFrame:
    """A frame of a dataset by its names; ``station`` is the key of a static camera or empty."""

    id: int
    group: str
    view: str
    match: str
    size: ImageSize
    station: str = ""


@dataclass(frozen=True)
class FrameNames:
    """Every spelling by which exactly one frame is meant.

    A broadcast frame is ``<match>/7_1.png``, with or without the folders before the match, its
    ending, or (where only one match has it) the match. A frame of a static camera is
    ``<camera>/<frame>`` or ``<frame>/<camera>``. Slashes may be spelt ``_``, ``__`` or ``-``.
    The names that exports give to frames are known, too.
    """

    frames: Mapping[int, NamedFrame]
    stations: Mapping[str, tuple[int, ...]]
    _index: Mapping[str, int] = field(repr=False)

    @staticmethod
    def of(frames: Iterable[NamedFrame]) -> FrameNames:
        """The index of a dataset's frames."""
        known = {frame.id: frame for frame in frames}
        index: dict[str, int] = {}
        stations: dict[str, list[int]] = {}
        for frame in known.values():
            if frame.station:
                stations.setdefault(frame.station, []).append(frame.id)
            for name in _spellings(frame):
                other = index.setdefault(name, frame.id)
                if other != frame.id:
                    index[name] = _SEVERAL
        return FrameNames(known, {key: tuple(ids) for key, ids in stations.items()}, index)

    def find(self, name: str) -> NamedFrame | None:
        """The one frame that a name means, or None.

        Folders before the part that is known do not matter: ``labels/test/a/b/c/7_1.txt``.
        """
        identity = self._lookup(name)
        return self.frames[identity] if identity is not None and identity != _SEVERAL else None

    def why_not(self, name: str) -> str:
        """Why ``find`` found nothing, in words."""
        if self._lookup(name) == _SEVERAL:
            return "fits several frames of the dataset; name its match, too"
        return "is no frame of the dataset"

    def of_station(self, name: str) -> tuple[int, ...]:
        """Ids of all frames of a static camera; empty when there is none of that name."""
        return self.stations.get(_bare(name).rsplit("/", 1)[-1], ())

    def _lookup(self, name: str) -> int | None:
        parts = _bare(name).split("/")
        for start in range(len(parts)):
            if start == len(parts) - 1 and any(_MATCH in part for part in parts[:start]):
                # 7_1 of a match that the dataset does not have is not the 7_1 that it has.
                return None
            found = self._index.get("/".join(parts[start:]))
            if found is not None:
                return found
        return None


def _bare(name: str) -> str:
    return _SUFFIX.sub("", name.replace("\\", "/").strip().strip("/"))


def _spellings(frame: NamedFrame) -> set[str]:
    view, group, match = _bare(frame.view), _bare(frame.group), _bare(frame.match)
    if frame.station:
        names = {f"{view}/{group}", f"{group}/{view}"}
        if match:
            names |= {f"{match}/{name}" for name in names}
    else:
        names = {view, f"{match}/{view}"} if match else {view, f"{group}/{view}"}
        names |= {f"{match.rsplit('/', 1)[-1]}/{view}"} if match else set()
    names |= {name.replace("/", glue) for name in names for glue in ("_", "__", "-")}
    return names | {name for name in _exported(frame) if name}


def _exported(frame: NamedFrame) -> Iterator[str]:
    """Names that our exports give to the frame, without the folder of a split."""
    station = Station(frame.station or frame.view, frame.size, shared=bool(frame.station))
    view = View(frame.view, station)
    group = Group(frame.group, (view,), match=frame.match)
    yield _bare(match_frame(group, view, "", ".jpg"))
    yield _bare(flat_frame(group, view, "", ".jpg").rsplit("/", 1)[-1])
