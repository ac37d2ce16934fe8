"""Picture check: what an import declares of its pictures, compared with the pictures themselves."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import PurePosixPath

from app.config import Settings
from app.db.store import Store
from app.errors import ImageError, NotFoundError, StorageError, TooLargeError
from app.features.datasets.queries import find_dataset
from app.features.findings.queries import replace_picture_shape_findings
from app.features.queue.refresh_queries import refresh_queue
from app.formats.report import ReaderReport
from app.media.files import read_declared_frame_count, read_picture_header, read_video_times
from app.media.images import SIDEWAYS, ImageHeader
from app.paint.view_paint import SHAPES_APART
from app.progress import ReportProgress
from app.soccer.frames import ImageSize
from app.soccer.group import Group, Media, View
from app.wording import plural

OUTSIDE = 0.02
"""Of a side; annotators of public datasets clicked up to 1 % beyond the border of a picture."""
NAMED = 5
"""Places of a kind that are named; the others are counted."""


_SHAPE = "The picture has another shape than its annotations"
_ADVICE = (
    "What is drawn on it lies in the wrong place. Import it with the right size or picture, or leave "
    "the view out."
)
LONGEST = 20_000
"""Frames that a video promises, up to which it is indexed by an import; beyond, when it is looked at."""


@dataclass(frozen=True)
class _VideoHeader:
    """A video: its size, how many frames it has, and why it cannot be read."""

    header: ImageHeader | None
    frames: int | None
    problem: str = ""


@dataclass
class PictureCheck:
    """Compares groups with their pictures on their way through an import.

    The same shape in another resolution is usual and no difference. Frames in object stores are
    not opened.

    Attributes:
        report: Counts pictures that EXIF turns.
        settings: Where indices of videos are kept, which are made here.
        progress: Hears how far a video is decoded, which takes minutes.
        shapes: Views whose picture has another shape than the file declares.
        outside: Views with annotations that lie outside their picture.
        beyond: Views whose video has no frame of their number.
    """

    report: ReaderReport
    settings: Settings
    progress: ReportProgress | None = None
    shapes: list[str] = field(default_factory=list)
    outside: list[str] = field(default_factory=list)
    beyond: list[str] = field(default_factory=list)
    found: list[tuple[str, str, str]] = field(default_factory=list)
    """Of ``shapes``: key of the group, key of the view, and the sentence of the finding."""
    groups: set[str] = field(default_factory=set)
    """Keys of the groups that were compared."""
    _stations: set[str] = field(default_factory=set)
    """Static cameras whose lines were looked at: every group brings them again."""
    _videos: dict[str, _VideoHeader] = field(default_factory=dict)
    _passed: int = 0

    def watch(self, groups: Iterable[Group]) -> Iterator[Group]:
        """The groups, each compared as it passes."""
        for group in groups:
            self.groups.add(group.key)
            for view in group.views:
                self._compare_view(group, view)
            self._passed += 1
            yield group

    def describe_differences(self) -> list[str]:
        """One sentence for each kind of difference."""
        found = []
        if self.shapes:
            found.append(
                f"{plural(len(self.shapes), 'picture has', 'pictures have')} another shape than "
                f"the file declares: {_join_places(self.shapes)}. Annotations on them lie in the wrong "
                "place: correct the size in the file, or replace the picture, and import again."
            )
        if self.outside:
            found.append(
                f"{plural(len(self.outside), 'view has', 'views have')} annotations outside the "
                f"picture: {_join_places(self.outside)}. Check the size that the file declares."
            )
        if self.beyond:
            found.append(
                f"{plural(len(self.beyond), 'view has', 'views have')} no frame in the video: "
                f"{_join_places(self.beyond)}. Check --frame-offset, and that it is the whole video."
            )
        return found

    def save_shape_findings(self, store: Store, dataset: str) -> int:
        """Put findings at the views whose picture has another shape; such a group passes its gates, and
        nobody shall take it for a sound one. Returns how many there are."""
        with store.write() as session:
            row = find_dataset(session, dataset)
            if row is not None:
                ids = replace_picture_shape_findings(session, int(row.id), self.groups, self.found)
                refresh_queue(session, ids)
        return len(self.found)

    def _compare_view(self, group: Group, view: View) -> None:
        place = f"group {group.key}, view {view.key}"
        header = None if view.media is None else self._read_picture_header(place, view.media)
        if header is not None:
            if header.orientation != 1:
                self.report.counts["pictures turned by EXIF"] += 1
            difference = _describe_shape_difference(view.size, header)
            if difference:
                self.shapes.append(f"{place}{_file_name(view.media)}: {difference}")
                self.found.append((group.key, view.key, f"{_SHAPE} ({difference}). {_ADVICE}"))
        if places := list(self._iterate_annotations_outside(view)):
            more = f" and {len(places) - 1} more" if len(places) > 1 else ""
            self.outside.append(
                f"{place}: {places[0]}{more}, of {view.size.width} x {view.size.height}"
            )

    def _read_picture_header(self, place: str, media: Media) -> ImageHeader | None:
        if media.frame is None:
            return read_picture_header(media)
        if media.path not in self._videos:
            self._videos[media.path] = self._read_video_header(media)
        video = self._videos[media.path]
        if video.problem:
            self.beyond.append(f"{place}: {video.problem}")
        elif video.frames is not None and not 0 <= media.frame < video.frames:
            name = PurePosixPath(media.path).name
            self.beyond.append(f"{place}: frame {media.frame} of {video.frames:,} ({name})")
        return video.header

    def _read_video_header(self, media: Media) -> _VideoHeader:
        """What a video is; its frames are counted here unless that takes too long."""
        header = read_picture_header(media)
        try:
            if read_declared_frame_count(media) > LONGEST:
                return _VideoHeader(header, None)
            return _VideoHeader(header, self._count_frames(media))
        except (NotFoundError, ImageError, StorageError, TooLargeError) as error:
            return _VideoHeader(header, None, error.message)

    def _count_frames(self, media: Media) -> int:
        """How many frames a video has; said while they are counted, which may take minutes."""
        name = PurePosixPath(media.path).name

        def report_counted_frames(frames: int) -> None:
            self._report_progress(f"Counting the frames of {name}: {frames:,} so far.")

        report_counted_frames(0)
        count = len(read_video_times(media, self.settings, report_counted_frames))
        self._report_progress("Reading the groups.")
        return count

    def _report_progress(self, sentence: str) -> None:
        if self.progress is not None:
            self.progress(self._passed, None, sentence)

    def _iterate_annotations_outside(self, view: View) -> Iterator[str]:
        """Annotations of a view that are outside its picture."""
        size = view.size
        for ball in view.balls:
            center = ball.center
            if center is not None and _is_outside(center.x, center.y, size):
                yield f"the ball at ({center.x:.0f}, {center.y:.0f})"
        for box in view.extras.pixel_boxes:
            if _is_outside(box.x + box.width / 2, box.y + box.height / 2, size):
                yield f"a box at ({box.x:.0f}, {box.y:.0f})"
        station = view.station
        if station.shared and station.key in self._stations:
            return
        self._stations.update([station.key] if station.shared else [])
        for marking, points in station.lines.items():
            for x, y in points:
                if _is_outside(x, y, size):
                    yield f"a point of {marking} at ({x:.0f}, {y:.0f})"


def _is_outside(x: float, y: float, size: ImageSize) -> bool:
    across, down = OUTSIDE * size.width, OUTSIDE * size.height
    return not (-across <= x <= size.width + across and -down <= y <= size.height + down)


def _describe_shape_difference(size: ImageSize, header: ImageHeader) -> str:
    """How the shape of a picture differs from what is declared; empty where it does not."""
    width, height = header.width, header.height
    if abs(width / height / (size.width / size.height) - 1) <= SHAPES_APART:
        return ""
    sentence = f"{size.width} x {size.height} declared, the picture is {width} x {height}"
    if (size.width, size.height) == (height, width):
        sentence += ", the same on its side"
        if header.orientation in SIDEWAYS:
            sentence += " (its EXIF orientation turns it)"
    return sentence


def _file_name(media: Media | None) -> str:
    return "" if media is None else f" ({PurePosixPath(media.member or media.path).name})"


def _join_places(places: list[str]) -> str:
    more = len(places) - NAMED
    return "; ".join(places[:NAMED]) + (f"; and {more:,} more" if more > 0 else "")
