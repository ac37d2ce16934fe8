"""ViPER XGTF ground truth: the ball's centre and boxes of people, per frame of one camera."""

from __future__ import annotations

import gzip
import re
import zipfile
import zlib
from dataclasses import dataclass, field
from typing import IO, Any
from xml.etree.ElementTree import Element, ParseError

from defusedxml import DefusedXmlException
from defusedxml.ElementTree import iterparse

from app.datasets import fields
from app.datasets.file_tree import DEFAULT_LIMITS, FileTree, Limits
from app.datasets.report import Report
from app.errors import DatasetFormatError
from app.finite import quoted

MAX_SPAN = 10_000
"""Most frames that one framespan may cover; ISSIA's longest covers its 3,029 frames."""

MAX_FRAMES = 100_000
"""Most frames with a ball in one file, each of which is a group: an hour at 25 frames a second."""

MAX_ENTRIES = 5_000_000
"""Most entries of one file; ISSIA's have 42,000."""

MAX_QUIET = 1_000_000
"""Most bytes between two elements; an entry has a hundred."""

_SPAN = re.compile(r"(\d{1,9}):(\d{1,9})", re.ASCII)
_DATA = "{http://lamp.cfar.umd.edu/viperdata#}"
_VIPER = "{http://lamp.cfar.umd.edu/viper#}"
_BROKEN = (EOFError, zlib.error, zipfile.BadZipFile, RuntimeError, OSError)


@dataclass
class ViperTrack:
    """What one XGTF file says, by its own frame numbers.

    Attributes:
        balls: Centres of the ball per frame, pixels.
        persons: Per frame: (id, x, y, width, height) of each person, pixels.
        ball_notes: Per frame: the ball's other attributes, as text.
        entries: Number of entries read, one for each frame of a framespan.
    """

    balls: dict[int, list[tuple[float, float]]] = field(default_factory=dict)
    persons: dict[int, list[tuple[str, float, float, float, float]]] = field(default_factory=dict)
    ball_notes: dict[int, dict[str, str]] = field(default_factory=dict)
    entries: int = 0

    @property
    def ball_points(self) -> int:
        """Number of annotated ball points."""
        return sum(map(len, self.balls.values()))

    @property
    def person_boxes(self) -> int:
        """Number of boxes of people."""
        return sum(map(len, self.persons.values()))


def read_viper(
    tree: FileTree, name: str, report: Report, limits: Limits = DEFAULT_LIMITS
) -> ViperTrack:
    """The annotations of one XGTF file, plain or ``.gz``.

    A DTD, and with it every entity, is refused. A damaged file keeps what was read before the
    damage, and says so. Numbers that are blank or wrong lose their own entry alone.
    """
    shown = tree.shown(name)
    track = ViperTrack()
    try:
        with tree.open(name) as stream:
            packed = name.lower().endswith(".gz")
            opened = gzip.GzipFile(fileobj=stream) if packed else stream
            _read_objects(_Capped(opened, limits.file_bytes, shown), track, shown, report)
    except DatasetFormatError as error:
        report.skip(error)
    except DefusedXmlException:
        report.note(shown, None, None, "holds a DTD or an entity, which is refused")
    except ParseError as error:
        place = f"line {error.position[0]}"
        report.note(shown, None, place, f"is not sound XML from here on; {_so_far(track)}")
    except (LookupError, ValueError) as error:
        report.note(shown, None, None, f"is in an encoding that cannot be read ({error})")
    except _BROKEN:
        report.note(shown, None, None, f"is damaged or cut off; {_so_far(track)}")
    return track


def _so_far(track: ViperTrack) -> str:
    return f"{track.ball_points} ball points and {track.person_boxes} persons before it are kept"


class _Capped:
    """A stream that counts real bytes, in all and since the last element.

    Expat before 2.6 looks at an unfinished tag again from its beginning with each piece of it.
    """

    def __init__(self, stream: IO[bytes] | gzip.GzipFile, limit: int, shown: str):
        self._stream, self._left, self._limit, self._shown = stream, limit, limit, shown
        self.quiet = 0
        """Bytes since the last element; who reads elements sets it back."""

    def read(self, size: int = -1) -> bytes:
        content = self._stream.read(size)
        self._left -= len(content)
        if self._left < 0:
            problem = f"is longer than {self._limit:,} bytes"
            raise DatasetFormatError(self._shown, None, None, problem)
        self.quiet += len(content)
        if self.quiet > MAX_QUIET:
            problem = f"holds more than {MAX_QUIET:,} bytes without an element"
            raise DatasetFormatError(self._shown, None, None, problem)
        return content


def _read_objects(stream: _Capped, track: ViperTrack, shown: str, report: Report) -> None:
    open_elements: list[Element] = []
    for event, element in iterparse(stream, events=("start", "end"), forbid_dtd=True):
        stream.quiet = 0
        if event == "start":
            open_elements.append(element)
            continue
        open_elements.pop()
        if element.tag.startswith(_DATA):
            _read_entry(element, open_elements, track, shown, report)
        if open_elements:
            # What was read is let go, or a long file would stay in memory.
            del open_elements[-1][:]


def _read_entry(
    item: Element, inside: list[Element], track: ViperTrack, shown: str, report: Report
) -> None:
    """One ``data:...`` element of an attribute of an object."""
    if len(inside) < 2 or inside[-2].tag != _VIPER + "object":
        return
    thing, attribute = inside[-2], inside[-1].get("name", "")
    kind, identity = thing.get("name", "").strip().upper(), thing.get("id", "?")[:20]
    if kind not in ("BALL", "PERSON"):
        return
    try:
        frames = _frames(item.get("framespan"))
        track.entries += len(frames)
        if track.entries > MAX_ENTRIES:
            raise DatasetFormatError(shown, None, None, f"holds more than {MAX_ENTRIES:,} entries")
        _read_item(kind, attribute, item, frames, identity, track)
    except ValueError as error:
        where = f"framespan {item.get('framespan', '')[:40]}"
        report.note(shown, f"{kind.title()} {identity}", where, str(error))


def _read_item(
    kind: str, attribute: str, item: Element, frames: list[int], identity: str, track: ViperTrack
) -> None:
    if kind == "BALL" and item.tag == _DATA + "point":
        point = (_pixel(item, "x"), _pixel(item, "y"))
        if len(track.balls) + len(frames) > MAX_FRAMES:
            fresh = sum(frame not in track.balls for frame in frames)
            if len(track.balls) + fresh > MAX_FRAMES:
                raise ValueError(f"is beyond {MAX_FRAMES:,} frames with a ball")
        for frame in frames:
            points = track.balls.setdefault(frame, [])
            if point not in points:
                points.append(point)
    elif kind == "PERSON" and item.tag == _DATA + "bbox":
        x, y, width, height = (_pixel(item, name) for name in ("x", "y", "width", "height"))
        if width < 0 or height < 0:
            raise ValueError("has a negative width or height")
        for frame in frames:
            track.persons.setdefault(frame, []).append((identity, x, y, width, height))
    elif kind == "BALL" and "value" in item.attrib:
        for frame in frames:
            track.ball_notes.setdefault(frame, {})[attribute[:80]] = item.get("value", "")[:200]


def _pixel(item: Element, name: str) -> float:
    if name not in item.attrib:
        raise ValueError(f"{name} is missing")
    try:
        return fields.pixel(item.get(name))
    except ValueError as error:
        raise ValueError(f"{name} {error}") from error


def _frames(span: Any) -> list[int]:
    """Frames of a framespan: ``1182:1182``, a range, or several separated by spaces or commas."""
    if not span or not span.strip():
        raise ValueError("has no framespan")
    frames: list[int] = []
    for part in re.split(r"[\s,]+", span.strip()):
        found = _SPAN.fullmatch(part)
        if found is None:
            raise ValueError(f"the framespan {quoted(part, 40)} is not first:last")
        first, last = int(found[1]), int(found[2])
        if last < first:
            raise ValueError(f"the framespan {part} ends before it begins")
        count = len(frames) + last - first + 1
        if count > MAX_SPAN:
            raise ValueError(f"covers {count:,} frames; at most {MAX_SPAN:,} are read")
        frames.extend(range(first, last + 1))
    return frames
