"""Frames: pictures of views, made in processes of their own.

A frame is a file of somebody else. What decodes it may need more memory or time than there is, or
crash; then one process ends, one request is refused, and the service goes on.
"""

from __future__ import annotations

import threading
from collections import OrderedDict
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future, wait
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from math import inf
from pathlib import Path
from time import monotonic
from typing import Any

from app.config import Settings
from app.errors import (
    ImageError,
    NotFoundError,
    OverloadedError,
    ReviewError,
    StorageError,
    TooLargeError,
)
from app.json_text import digest_content
from app.media.files import (
    describe_frame,
    guess_content_type,
    has_member,
    has_video_index,
    make_frame_stamp,
    make_video_stamp,
    read_cached_frame,
    read_encoded_frame,
    read_picture_header,
    read_video_times,
)
from app.media.images import JPEG
from app.media.object_frames import fetch_frame, is_cached, is_in_object_store
from app.media.video import Times, get_remembered_index, remember_index
from app.progress import ReportProgress
from app.soccer.group import FARTHEST, Media, split_frame_number
from app.worker_pool import Explain, PoolTask, WorkerPool
from app.worker_process import COUNTS, WorkerEnded, WorkerLimits


def find_neighbouring_frames(
    media: Media, group: str, static: bool, settings: Settings
) -> dict[int, Media]:
    """Frames of the same camera up to ``FARTHEST`` before and after, by how many frames later.

    Args:
        media: Where the view's own frame lies.
        group: Key of the view's group, which is the number of its frame for static cameras.
        static: Whether the camera stands still, so that its files are numbered by frames.
        settings: Where indices of videos are kept.

    None of a frame in an object store, which would have to be asked for each.
    """
    if is_in_object_store(media):
        return {}
    try:
        if media.frame is not None:
            return dict(
                _find_neighbours_in_video(
                    media, media.frame, len(read_video_times(media, settings))
                )
            )
        return dict(_find_neighbours_among_files(media, group, static))
    except (NotFoundError, ImageError, StorageError, TooLargeError):
        return {}


def _list_neighbour_offsets() -> Iterator[int]:
    return (offset for offset in range(-FARTHEST, FARTHEST + 1) if offset)


def _find_neighbours_in_video(media: Media, frame: int, count: int) -> Iterator[tuple[int, Media]]:
    for offset in _list_neighbour_offsets():
        if 0 <= frame + offset < count:
            yield offset, replace(media, frame=frame + offset)


def _find_neighbours_among_files(
    media: Media, group: str, static: bool
) -> Iterator[tuple[int, Media]]:
    for offset in _list_neighbour_offsets():
        there = find_later_frame_file(media, group, static=static, later=offset)
        if there is not None:
            yield offset, there


def find_later_frame_file(media: Media, group: str, *, static: bool, later: int) -> Media | None:
    """The file of a frame so many frames later than another one's; None where there is none."""
    found = split_frame_number(media, group, static)
    number = -1 if found is None else int(found[2]) + later
    if found is None or number < 0:
        return None
    name, head, digits = found
    # 100 may follow 099 or 99.
    for text in dict.fromkeys((f"{number:0{len(digits)}d}", str(number))):
        there = _find_neighbour_file(media, str(name.with_name(f"{head}{text}{name.suffix}")))
        if there is not None:
            return there
    return None


def _find_neighbour_file(media: Media, name: str) -> Media | None:
    """The neighbour of that name, in the same folder or archive, if it is one."""
    if media.member is not None:
        return replace(media, member=name) if has_member(media, name) else None
    # A link could lead out of the folder that was imported.
    path = Path(name)
    return replace(media, path=name) if path.is_file() and not path.is_symlink() else None


LIMITS = WorkerLimits(memory=1024 * 2**20, processor=10.0, silence=60.0)
"""For one picture: one of 50 megapixels takes a few hundred MiB and two seconds."""
READING = WorkerLimits(memory=2 * 2**30, processor=60.0, silence=180.0)
"""For reading what a picture shows; the first time it is compiled, which takes eleven seconds."""
READERS = 2
"""Pictures that are read at once; apart from those that are made, so that nobody's view waits."""
FETCHING = WorkerLimits(memory=1024 * 2**20, processor=20.0, silence=120.0)
"""For one frame of an object store; the time that a store may take is a setting of it."""
FETCHERS = 2
"""Frames that are fetched from stores at once; apart, so that a slow store delays no other frame."""
INDEXING = WorkerLimits(memory=1024 * 2**20, processor=3600.0, silence=3600.0)
"""For decoding a whole video once, so that its frames are found: 1080p takes 4 ms a frame."""
INDEXERS = 1
UNKEPT = 8
"""Videos whose indices are remembered that the disk refuses."""
REPORT_SECONDS = 1.0
"""Between two words of whoever waits for an index."""
WAITING = 64
"""Pictures that may wait; one more is told to come back."""
REMEMBERED = 256
"""Frames that went beyond the limits and are not tried again, in whatever width."""
REMEMBERED_SECONDS = {"memory": inf, "processor": inf, "silence": 300.0}
"""How long, by the way in which a frame went beyond the limits: a busy machine is silent, too.
Whatever else ends a process is the machine's doing, and the frame is tried again."""


@dataclass(frozen=True)
class EncodedPicture:
    """A frame as it is sent.

    Attributes:
        kind: Media type, by the bytes themselves.
        data: The bytes.
        digest: Of the bytes, 32 hexadecimal digits.
        as_stored: Whether they are known to be those of the file: not scaled, turned or decoded.
    """

    kind: str
    data: bytes
    digest: str
    as_stored: bool = False

    @staticmethod
    def of(kind: str, data: bytes, as_stored: bool = False) -> EncodedPicture:
        """The picture of these bytes."""
        return EncodedPicture(kind, data, digest_content(data), as_stored)


class FrameProvider:
    """Makes pictures; few at once, and none that nobody waits for."""

    def __init__(self, settings: Settings):
        self._settings = settings
        self._pool = WorkerPool(
            LIMITS, settings.image_workers, WAITING, "pictures", COUNTS["pictures"]
        )
        self._readers = WorkerPool(READING, READERS, WAITING, "pictures", COUNTS["readers"])
        self._fetchers = WorkerPool(FETCHING, FETCHERS, WAITING, "pictures", COUNTS["fetchers"])
        self._videos = VideoIndexer(settings)
        self._refused: OrderedDict[str, tuple[ReviewError, float]] = OrderedDict()
        self._lock = threading.Lock()

    def warm(self) -> None:
        """Start a process before anybody waits for it."""
        self._pool.submit(preload_libraries, bounded=False)

    def read_cached(self, media: Media, width: int | None, flipped: bool) -> EncodedPicture | None:
        """What was made before, where it is kept.

        Raises:
            NotFoundError: The file is not there.
            TooLargeError: It was tried before, and went beyond the limits.
        """
        self._require_not_refused(media)
        data = read_cached_frame(media, width, flipped, self._settings)
        return None if data is None else EncodedPicture.of(JPEG, data)

    def request_frame_preparation(self, media: Media) -> PoolTask | None:
        """Have a frame made ready; None where it is: one of a store is brought to this disk, and
        the video of one is indexed.

        Its future may have the errors of ``fetch_frame`` and ``read_video_times``.

        Raises:
            OverloadedError: Too many wait.
        """
        return self._submit_frame_preparation(media, bounded=True)

    def request_picture(self, media: Media, width: int | None, flipped: bool) -> PoolTask:
        """Have a picture made; its future has it, or the errors of ``read_encoded_frame``.

        Raises:
            OverloadedError: Too many wait.
        """
        return self._submit_picture(media, width, flipped, bounded=True)

    def read(self, media: Media, width: int | None, flipped: bool) -> EncodedPicture:
        """A picture, waited for however many others wait: for background work."""
        found = self.read_cached(media, width, flipped)
        if found is not None:
            return found
        fetching = self._submit_frame_preparation(media, bounded=False)
        if fetching is not None:
            fetching.future.result()
        made: EncodedPicture = self._submit_picture(
            media, width, flipped, bounded=False
        ).future.result()
        return made

    def request_neighbours(self, media: Media, group: str, static: bool) -> PoolTask:
        """Have ``find_neighbouring_frames`` called, which opens videos and archives.

        Its future may have ``WorkerEnded``.

        Raises:
            OverloadedError: Too many wait.
        """
        work = self._videos.make_worker_call(
            media, find_neighbouring_frames, media, group, static, self._settings
        )
        return self._pool.submit(*work)

    def close(self) -> None:
        """End the processes."""
        self._pool.close()
        self._readers.close()
        self._fetchers.close()
        self._videos.close()

    def request_work_on_frame(
        self, media: Media, flipped: bool, work: Callable[..., Any], *arguments: Any
    ) -> PoolTask:
        """Have a function called with a frame, ``work(media, flipped, settings, *arguments)``.

        Its future may have the errors of ``decode_frame``.

        Raises:
            OverloadedError: Too many wait.
        """

        def explain(error: WorkerEnded) -> ReviewError:
            return make_picture_error(describe_frame(media), error)

        return self._submit_read(
            media, work, media, flipped, self._settings, *arguments, explain=explain
        )

    def request_work(
        self, media: Media | None, work: Callable[..., Any], *arguments: Any
    ) -> PoolTask:
        """Have a function called that reads a frame itself, ``work(*arguments, settings)``.

        Its future may have ``WorkerEnded``, or say why its video cannot be indexed.

        Args:
            media: The frame; None: it reads none.
            work: The function.
            arguments: What it is called with.

        Raises:
            OverloadedError: Too many wait.
        """
        return self._submit_read(media, work, *arguments, self._settings)

    def _submit_read(
        self,
        media: Media | None,
        work: Callable[..., Any],
        *arguments: Any,
        explain: Explain = lambda error: error,
    ) -> PoolTask:
        """Have a frame read, once its video is indexed: a reader has not the time for that."""

        def submit(bounded: bool) -> PoolTask:
            call = (work, *arguments)
            if media is not None:
                call = self._videos.make_worker_call(media, *call)
            return self._readers.submit(*call, explain=explain, bounded=bounded)

        indexing = None
        if media is not None:
            # Of a video that is not there, or is none, its reader says so at once.
            with suppress(NotFoundError):
                indexing = self._videos.request_indexing(media)
        if indexing is None:
            return submit(bounded=True)
        waiting = PoolTask(explain)

        def continue_after_index(done: Future[Any]) -> None:
            if waiting.future.cancelled():
                return
            error = None if done.cancelled() else done.exception()
            if done.cancelled() or not isinstance(error, ImageError | NotFoundError | None):
                _forward_result(waiting.future, done)
                return
            # It has waited already.
            reading = submit(bounded=False)
            waiting.future.add_done_callback(
                lambda one: reading.abandon() if one.cancelled() else None
            )
            reading.future.add_done_callback(partial(_forward_result, waiting.future))

        indexing.future.add_done_callback(continue_after_index)
        return waiting

    def _submit_frame_preparation(self, media: Media, *, bounded: bool) -> PoolTask | None:
        if media.frame is not None:
            return self._videos.request_indexing(media, bounded=bounded)
        if not is_in_object_store(media) or is_cached(media, self._settings):
            return None

        def explain(error: WorkerEnded) -> ReviewError:
            return StorageError(f"{describe_frame(media)} {error}", hint="Try again in a moment.")

        return self._fetchers.submit(
            fetch_frame, media, self._settings, explain=explain, bounded=bounded
        )

    def _submit_picture(
        self, media: Media, width: int | None, flipped: bool, *, bounded: bool
    ) -> PoolTask:
        def explain(error: WorkerEnded) -> ReviewError:
            refusal = make_picture_error(describe_frame(media), error)
            if error.reason in REMEMBERED_SECONDS:
                self._remember_refusal(media, refusal, REMEMBERED_SECONDS[error.reason])
            return refusal

        work = self._videos.make_worker_call(
            media, make_picture, media, width, flipped, self._settings
        )
        return self._pool.submit(
            *work,
            explain=explain,
            # Other widths of it may have waited while it was tried.
            begin=partial(self._require_not_refused, media),
            bounded=bounded,
        )

    def _require_not_refused(self, media: Media) -> None:
        """Raise the refusal of a frame that went beyond the limits, while it is remembered."""
        with self._lock:
            refusal, until = self._refused.get(make_frame_stamp(media), (None, 0.0))
        if refusal is not None and monotonic() < until:
            raise refusal

    def _remember_refusal(self, media: Media, refusal: ReviewError, seconds: float) -> None:
        with self._lock:
            self._refused[make_frame_stamp(media)] = (refusal, monotonic() + seconds)
            while len(self._refused) > REMEMBERED:
                self._refused.popitem(last=False)


class VideoIndexer:
    """Has videos indexed in a process of its own, each once, before frames of them are read."""

    def __init__(self, settings: Settings):
        self._settings = settings
        self.pool = WorkerPool(INDEXING, INDEXERS, WAITING, "videos", COUNTS["indexers"])
        self._running: dict[str, PoolTask] = {}
        self._unkept: OrderedDict[str, tuple[str, Times]] = OrderedDict()
        self._lock = threading.Lock()

    def request_indexing(self, media: Media, *, bounded: bool = True) -> PoolTask | None:
        """Have the video of a frame indexed; None where it is, and where it is no video.

        Its future may have the errors of ``read_video_times``.

        Raises:
            NotFoundError: The video is not there.
            OverloadedError: Too many wait.
        """
        if media.frame is None or self._has_index(media):
            return None

        def explain(error: WorkerEnded) -> ReviewError:
            return make_picture_error(describe_frame(replace(media, frame=None)), error)

        with self._lock:
            running = self._running.get(media.path)
            if running is None:
                running = self.pool.submit(
                    index_video, media, self._settings, explain=explain, bounded=bounded
                )
                self._running[media.path] = running
        running.future.add_done_callback(partial(self._finish_indexing, media.path))
        # Who waits may leave; the index is made all the same, for it takes long and is needed again.
        waiting = PoolTask(explain)
        running.future.add_done_callback(partial(_forward_result, waiting.future))
        return waiting

    def index_videos(
        self,
        pictures: Iterable[Media | None],
        done: int,
        total: int,
        progress: ReportProgress | None,
    ) -> None:
        """Index the videos of frames that will be read; what is wrong with one its reader says.

        Args:
            pictures: The frames.
            done: How far the whole work is.
            total: How much there is to do in it.
            progress: Hears every second which video is indexed; what it raises ends the waiting.
        """
        for media in pictures:
            indexing = None
            if media is not None:
                with suppress(NotFoundError):
                    indexing = self.request_indexing(media, bounded=False)
            while indexing is not None and not indexing.future.done():
                wait([indexing.future], REPORT_SECONDS)
                if progress is not None and media is not None:
                    progress(done, total, f"Finding the frames of {Path(media.path).name}.")

    def make_worker_call(
        self, media: Media, work: Callable[..., Any], *arguments: Any
    ) -> tuple[Callable[..., Any], *tuple[Any, ...]]:
        """What to call in a process for ``work(*arguments)``, which reads a frame.

        It brings the index along that the disk refused.
        """
        unkept = None if media.frame is None else self._unkept.get(media.path)
        return (
            (work, *arguments)
            if unkept is None
            else (call_with_index_remembered, *unkept, work, *arguments)
        )

    def close(self) -> None:
        """End the process."""
        self.pool.close()

    def _has_index(self, media: Media) -> bool:
        if has_video_index(media, self._settings):
            return True
        stamp, _ = self._unkept.get(media.path, ("", None))
        return stamp == make_video_stamp(media)

    def _finish_indexing(self, path: str, done: Future[Any]) -> None:
        if not done.cancelled() and done.exception() is None:
            stamp, unkept = done.result()
            if unkept is not None:
                with self._lock:
                    self._unkept[path] = stamp, unkept
                    while len(self._unkept) > UNKEPT:
                        self._unkept.popitem(last=False)
        self._running.pop(path, None)


def _forward_result(waiting: Future[Any], done: Future[Any]) -> None:
    """Give what became of a task to one who waits for it."""
    if done.cancelled():
        waiting.cancel()
    elif waiting.set_running_or_notify_cancel():
        error = done.exception()
        if error is None:
            waiting.set_result(done.result())
        else:
            waiting.set_exception(error)


def make_picture_error(name: str, error: WorkerEnded) -> ReviewError:
    """The error for a worker that ended on a picture: it blames the picture, or the machine."""
    if error.reason in ("killed", "terminated"):
        more = " Where it happens often, give more memory." if error.reason == "killed" else ""
        return OverloadedError(f"{name} {error}", hint=f"Try again in a moment.{more}")
    kind = ImageError if error.reason == "crash" else TooLargeError
    return kind(f"{name} {error}")


def make_picture(
    media: Media, width: int | None, flipped: bool, settings: Settings
) -> EncodedPicture:
    """A picture, made in this process."""
    data = read_encoded_frame(media, width, flipped, settings)
    header = read_picture_header(media) if width is None and not flipped else None
    as_stored = media.frame is None and header is not None and header.orientation == 1
    return EncodedPicture.of(guess_content_type(data), data, as_stored)


def index_video(media: Media, settings: Settings) -> tuple[str, Times | None]:
    """Make the index of a video, in this process: name of its content, and the index itself where
    the disk refuses it."""
    read_video_times(media, settings)
    stamp = make_video_stamp(media)
    return stamp, get_remembered_index(stamp)


def call_with_index_remembered(
    stamp: str, times: Times, work: Callable[..., Any], *arguments: Any
) -> Any:
    """``work(*arguments)`` in this process, which remembers an index from now on."""
    remember_index(stamp, times)
    return work(*arguments)


def preload_libraries() -> None:
    """What a process does that shall only be there: it has loaded what it needs."""
