"""ViPER XGTF ground truth: the ball and boxes of people, per frame of one camera."""

from __future__ import annotations

import gzip
import re
import zipfile
import zlib
from collections import Counter
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import IO, Any
from xml.etree.ElementTree import Element, ParseError

from defusedxml import DefusedXmlException
from defusedxml.ElementTree import iterparse

from app.errors import DatasetFormatError
from app.formats import fields
from app.formats.ball_names import is_ball_name
from app.formats.file_tree import DEFAULT_LIMITS, FileTree, ImportLimits
from app.formats.report import ReaderReport
from app.json_text import quote_text
from app.soccer.frames import Box, ImagePoint, ImageSize
from app.wording import plural

MAX_SPAN = 10_000
"""Most frames that one framespan may cover; ISSIA's longest covers its 3,029 frames."""

MAX_FRAMES = 100_000
"""Most frames with a ball in one file, each of which is a group: an hour at 25 frames a second."""

MAX_ENTRIES = 5_000_000
"""Most entries of one file; ISSIA's have 42,000."""

MAX_QUIET = 1_000_000
"""Most bytes between two elements; an entry has a hundred."""

_SPAN = re.compile(r"(\d{1,9}):(\d{1,9})", re.ASCII)
_PERSONS = frozenset({"person"})
_SHAPES = "balls are read as point, bbox or circle, people as bbox of an object Person"
_SIZES = ("H-FRAME-SIZE", "V-FRAME-SIZE")
_MAX_SIDE = 65_535
_MAX_KINDS = 100
"""Kinds of entries left out that are named each for itself."""
_HEAD = 64 * 1024
_is_ball = lru_cache(maxsize=100)(is_ball_name)
_BROKEN = (EOFError, zlib.error, zipfile.BadZipFile, RuntimeError, OSError)


@dataclass
class ViperVideo:
    """What one source (video) of an XGTF file says, by its own frame numbers.

    Attributes:
        balls: Balls per frame, pixels: centres, or boxes where boxes or circles were drawn.
        persons: Per frame: (id, x, y, width, height) of each person, pixels.
        ball_notes: Per frame: the ball's other attributes, as text.
        source: Name of the video, as the file has it.
        size: Of its frames, where the file says it.
    """

    balls: dict[int, list[ImagePoint | Box]] = field(default_factory=dict)
    persons: dict[int, list[tuple[str, float, float, float, float]]] = field(default_factory=dict)
    ball_notes: dict[int, dict[str, str]] = field(default_factory=dict)
    source: str = ""
    size: ImageSize | None = None

    @property
    def ball_point_count(self) -> int:
        """Number of annotated balls."""
        return sum(map(len, self.balls.values()))

    @property
    def person_box_count(self) -> int:
        """Number of boxes of people."""
        return sum(map(len, self.persons.values()))


def is_viper_file(tree: FileTree, name: str) -> bool:
    """Whether a file begins as XGTF does, whatever its ending."""
    try:
        with tree.open(name) as stream:
            packed = name.lower().endswith(".gz")
            head = (gzip.GzipFile(fileobj=stream) if packed else stream).read(_HEAD)
    except (DatasetFormatError, *_BROKEN):
        return False
    return re.search(rb"<([\w.-]+:)?viper[\s>]", head) is not None


def read_viper(
    tree: FileTree, name: str, report: ReaderReport, limits: ImportLimits = DEFAULT_LIMITS
) -> list[ViperVideo]:
    """The annotations of one XGTF file, plain or ``.gz``: one track for each source, at least one.

    A DTD, and with it every entity, is refused. A damaged file keeps what was read before the
    damage, and says so. Numbers that are blank or wrong lose their own entry alone. Objects and
    shapes that are not read are counted and named. Elements count by their names alone, under
    whatever namespace.
    """
    shown = tree.shown(name)
    reader = _ViperFileReader(shown, report)
    try:
        with tree.open(name) as stream:
            packed = name.lower().endswith(".gz")
            opened = gzip.GzipFile(fileobj=stream) if packed else stream
            reader.read_elements(_LimitedStream(opened, limits.file_bytes, shown))
    except DatasetFormatError as error:
        report.add_problem(error)
    except DefusedXmlException:
        report.add_problem_at(shown, None, None, "holds a DTD or an entity, which is refused")
    except ParseError as error:
        place = f"line {error.position[0]}"
        report.add_problem_at(
            shown, None, place, f"is not sound XML from here on; {reader.kept_summary}"
        )
    except (LookupError, ValueError) as error:
        report.add_problem_at(shown, None, None, f"is in an encoding that cannot be read ({error})")
    except _BROKEN:
        report.add_problem_at(shown, None, None, f"is damaged or cut off; {reader.kept_summary}")
    return reader.finish_videos()


class _LimitedStream:
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


class _ViperFileReader:
    """One file on its way to tracks."""

    def __init__(self, shown: str, report: ReaderReport):
        self.tracks = [ViperVideo()]
        self._shown, self._report = shown, report
        self._sources = self._entries = self._frames = 0
        self._left_out: Counter[tuple[str, str]] = Counter()

    @property
    def kept_summary(self) -> str:
        """What is kept of a file that goes no further, in words."""
        balls = sum(track.ball_point_count for track in self.tracks)
        persons = sum(track.person_box_count for track in self.tracks)
        return f"{balls} ball points and {persons} persons before it are kept"

    def read_elements(self, stream: _LimitedStream) -> None:
        """Element by element."""
        open_elements: list[Element] = []
        for event, element in iterparse(stream, events=("start", "end"), forbid_dtd=True):
            stream.quiet = 0
            if event == "start":
                if _local_name(element) == "sourcefile":
                    self._begin_source(element.get("filename", "")[:200])
                open_elements.append(element)
                continue
            open_elements.pop()
            if len(open_elements) > 1 and _local_name(open_elements[-1]) == "attribute":
                self._read_entry(element, open_elements[-1], open_elements[-2])
            if open_elements:
                # What was read is let go, or a long file would stay in memory.
                del open_elements[-1][:]

    def finish_videos(self) -> list[ViperVideo]:
        """The tracks; reports what was not read, a line for each kind of object and shape."""
        for (name, what), count in self._left_out.items():
            entries = plural(count, "entry is", "entries are")
            self._report.add_problem_at(
                self._shown, f"object {name}", what, f"{entries} left out: {_SHAPES}"
            )

        for track in self.tracks:
            if track.size is not None and not track.size.width * track.size.height:
                track.size = None
        return self.tracks

    def _begin_source(self, name: str) -> None:
        self._sources += 1
        if self._sources > 1:
            self.tracks.append(ViperVideo())
        self.tracks[-1].source = name

    def _read_entry(self, item: Element, attribute: Element, owner: Element) -> None:
        """One ``data:...`` element of an attribute of an object, or of the file itself."""
        name = attribute.get("name", "")
        if _local_name(owner) == "file" and name in _SIZES:
            self._read_side_length(name, item)
        if _local_name(owner) != "object":
            return
        kind, identity = owner.get("name", "").strip()[:80], owner.get("id", "?")[:20]
        ball, shape = _is_ball(kind), _local_name(item)
        # What has no framespan of its own holds as long as its object does.
        span = item.get("framespan", owner.get("framespan"))
        try:
            if ball and shape in ("point", "bbox", "circle"):
                self._add_ball(_parse_ball(item, shape), self._parse_and_count_frames(span))
            elif ball and "value" in item.attrib:
                for frame in self._parse_and_count_frames(span):
                    notes = self.tracks[-1].ball_notes.setdefault(frame, {})
                    notes[name[:80]] = item.get("value", "")[:200]
            elif _keep_lowercase_letters(kind) in _PERSONS and shape == "bbox":
                box, frames = _parse_box(item), self._parse_and_count_frames(span)
                for frame in frames:
                    self.tracks[-1].persons.setdefault(frame, []).append((identity, *box))
            else:
                self._count_left_out(kind, f"{name[:80]}, {shape[:20]}")
        except ValueError as error:
            where = f"framespan {(span or '')[:40]}"
            self._report.add_problem_at(
                self._shown, f"{kind.title()} {identity}", where, str(error)
            )

    def _count_left_out(self, kind: str, what: str) -> None:
        key = (kind, what)
        if key not in self._left_out and len(self._left_out) >= _MAX_KINDS:
            key = ("of other names", "")
        self._left_out[key] += 1

    def _parse_and_count_frames(self, span: str | None) -> list[int]:
        """Frames of a framespan, counted against the limit of a file."""
        frames = _parse_framespan(span)
        self._entries += len(frames)
        if self._entries > MAX_ENTRIES:
            problem = f"holds more than {MAX_ENTRIES:,} entries"
            raise DatasetFormatError(self._shown, None, None, problem)
        return frames

    def _add_ball(self, ball: ImagePoint | Box, frames: list[int]) -> None:
        balls = self.tracks[-1].balls
        fresh = sum(frame not in balls for frame in frames)
        if self._frames + fresh > MAX_FRAMES:
            raise ValueError(f"has more than {MAX_FRAMES:,} frames with a ball")
        self._frames += fresh
        for frame in frames:
            _add_distinct_ball(balls.setdefault(frame, []), ball)

    def _read_side_length(self, name: str, item: Element) -> None:
        text = item.get("value", "").strip()
        if not text:
            return
        try:
            side = fields.parse_whole_number(text)
        except ValueError:
            side = 0
        if not 1 <= side <= _MAX_SIDE:
            self._report.add_problem_at(
                self._shown, name, "value", f"{quote_text(text, 40)} is not a size; left out"
            )
            return
        size = self.tracks[-1].size or ImageSize(0, 0)
        is_width = name == _SIZES[0]
        self.tracks[-1].size = replace(size, **{"width" if is_width else "height": side})


def _local_name(element: Element) -> str:
    """Name of an element without its namespace."""
    return element.tag.rpartition("}")[2]


@lru_cache(maxsize=100)
def _keep_lowercase_letters(name: str) -> str:
    return re.sub(r"[^a-z]", "", name.lower())


def _add_distinct_ball(balls: list[ImagePoint | Box], ball: ImagePoint | Box) -> None:
    """Add a ball to those of its frame, unless it is there: a centre inside a box is that ball's,
    and says where it is more exactly."""
    for index, known in enumerate(balls):
        if known == ball or (isinstance(ball, Box) and _is_inside(known, ball)):
            return
        if _is_inside(ball, known):
            balls[index] = ball
            return
    balls.append(ball)


def _is_inside(point: ImagePoint | Box, box: ImagePoint | Box) -> bool:
    if isinstance(point, Box) or not isinstance(box, Box):
        return False
    return 0 <= point.x - box.x <= box.width and 0 <= point.y - box.y <= box.height


def _parse_ball(item: Element, shape: str) -> ImagePoint | Box:
    if shape == "bbox":
        box = Box(*_parse_box(item))
        # A box without area is the ball's centre alone.
        return box if box.width > 0 and box.height > 0 else box.center
    point = ImagePoint(_parse_pixel(item, "x"), _parse_pixel(item, "y"))
    if shape == "point":
        return point
    radius = _parse_pixel(item, "radius")
    if radius < 0:
        raise ValueError("has a negative radius")
    return Box.square(point, 2 * radius) if radius > 0 else point


def _parse_box(item: Element) -> tuple[float, float, float, float]:
    x, y, width, height = (_parse_pixel(item, name) for name in ("x", "y", "width", "height"))
    if width < 0 or height < 0:
        raise ValueError("has a negative width or height")
    return x, y, width, height


def _parse_pixel(item: Element, name: str) -> float:
    if name not in item.attrib:
        raise ValueError(f"{name} is missing")
    try:
        return fields.parse_pixel_coordinate(item.get(name))
    except ValueError as error:
        raise ValueError(f"{name} {error}") from error


def _parse_framespan(span: Any) -> list[int]:
    """Frames of a framespan: ``1182:1182``, a range, or several separated by spaces or commas."""
    if not span or not span.strip():
        raise ValueError("has no framespan")
    frames: list[int] = []
    for part in re.split(r"[\s,]+", span.strip()):
        found = _SPAN.fullmatch(part)
        if found is None:
            raise ValueError(f"the framespan {quote_text(part, 40)} is not first:last")
        first, last = int(found[1]), int(found[2])
        if last < first:
            raise ValueError(f"the framespan {part} ends before it begins")
        count = len(frames) + last - first + 1
        if count > MAX_SPAN:
            raise ValueError(
                f"is left out: it covers {count:,} frames, and the limit is {MAX_SPAN:,}"
            )
        frames.extend(range(first, last + 1))
    return frames
