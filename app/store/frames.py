"""Frames: pictures of views, made in processes of their own.

A frame is a file of somebody else. What decodes it may need more memory or time than there is, or
crash; then one process ends, one request is refused, and the service goes on.
"""

from __future__ import annotations

import threading
from collections import OrderedDict
from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import dataclass, replace
from functools import partial
from math import inf
from time import monotonic
from typing import Any

from app.canonical import digest_of
from app.child import Allowance, ChildEnded
from app.child_figures import FIGURES
from app.child_pool import ChildPool, PoolTask
from app.config import Settings
from app.errors import ImageError, OverloadedError, ReviewError, StorageError, TooLargeError
from app.soccer.media import Media
from app.store.image_header import JPEG
from app.store.media import (
    cached_frame,
    content_type,
    frame_name,
    frame_stamp,
    has_index,
    read_frame,
    video_times,
)
from app.store.neighbours import neighbours
from app.store.object_frames import fetch_frame, is_kept, is_stored

ALLOWANCE = Allowance(memory=1024 * 2**20, processor=10.0, silence=60.0)
"""For one picture: one of 50 megapixels takes a few hundred MiB and two seconds."""
READING = Allowance(memory=2 * 2**30, processor=60.0, silence=180.0)
"""For reading what a picture shows; the first time it is compiled, which takes eleven seconds."""
READERS = 2
"""Pictures that are read at once; apart from those that are made, so that nobody's view waits."""
FETCHING = Allowance(memory=1024 * 2**20, processor=20.0, silence=120.0)
"""For one frame of an object store; the time that a store may take is a setting of it."""
FETCHERS = 2
"""Frames that are fetched from stores at once; apart, so that a slow store delays no other frame."""
INDEXING = Allowance(memory=1024 * 2**20, processor=3600.0, silence=3600.0)
"""For decoding a whole video once, so that its frames are found: 1080p takes 4 ms a frame."""
INDEXERS = 1
WAITING = 64
"""Pictures that may wait; one more is told to come back."""
REMEMBERED = 256
"""Frames that went beyond the allowance and are not tried again, in whatever width."""
REMEMBERED_SECONDS = {"memory": inf, "processor": inf, "silence": 300.0}
"""How long, by the way in which a frame went beyond the allowance: a busy machine is silent, too.
Whatever else ends a process is the machine's doing, and the frame is tried again."""


@dataclass(frozen=True)
class SentPicture:
    """A frame as it is sent.

    Attributes:
        kind: Media type, by the bytes themselves.
        data: The bytes.
        digest: Of the bytes, 32 hexadecimal digits.
    """

    kind: str
    data: bytes
    digest: str

    @staticmethod
    def of(kind: str, data: bytes) -> SentPicture:
        """The picture of these bytes."""
        return SentPicture(kind, data, digest_of(data))


class Frames:
    """Makes pictures; few at once, and none that nobody waits for."""

    def __init__(self, settings: Settings):
        self._settings = settings
        self._pool = ChildPool(
            ALLOWANCE, settings.image_workers, WAITING, "pictures", FIGURES["pictures"]
        )
        self._readers = ChildPool(READING, READERS, WAITING, "pictures", FIGURES["readers"])
        self._fetchers = ChildPool(FETCHING, FETCHERS, WAITING, "pictures", FIGURES["fetchers"])
        self._indexers = ChildPool(INDEXING, INDEXERS, WAITING, "videos", FIGURES["indexers"])
        self._refused: OrderedDict[str, tuple[ReviewError, float]] = OrderedDict()
        self._indexing: dict[str, PoolTask] = {}
        self._lock = threading.Lock()

    def warm(self) -> None:
        """Start a process before anybody waits for it."""
        self._pool.submit(ready, bounded=False)

    def cached(self, media: Media, width: int | None, flipped: bool) -> SentPicture | None:
        """What was made before, where it is kept.

        Raises:
            NotFoundError: The file is not there.
            TooLargeError: It was tried before, and went beyond the allowance.
        """
        self._require_untried(media)
        data = cached_frame(media, width, flipped, self._settings)
        return None if data is None else SentPicture.of(JPEG, data)

    def ask_fetch(self, media: Media) -> PoolTask | None:
        """Have a frame made ready; None where it is: one of a store is brought to this disk, and
        the video of one is indexed.

        Its future may have the errors of ``fetch_frame`` and ``video_times``.

        Raises:
            OverloadedError: Too many wait.
        """
        return self._fetch(media, bounded=True)

    def ask(self, media: Media, width: int | None, flipped: bool) -> PoolTask:
        """Have a picture made; its future has it, or the errors of ``read_frame``.

        Raises:
            OverloadedError: Too many wait.
        """
        return self._submit(media, width, flipped, bounded=True)

    def read(self, media: Media, width: int | None, flipped: bool) -> SentPicture:
        """A picture, waited for however many others wait: for background work."""
        found = self.cached(media, width, flipped)
        if found is not None:
            return found
        fetching = self._fetch(media, bounded=False)
        if fetching is not None:
            fetching.future.result()
        made: SentPicture = self._submit(media, width, flipped, bounded=False).future.result()
        return made

    def ask_neighbours(self, media: Media, group: str, static: bool) -> PoolTask:
        """Have ``neighbours`` called, which opens videos and archives.

        Its future may have ``ChildEnded``.

        Raises:
            OverloadedError: Too many wait.
        """
        return self._pool.submit(neighbours, media, group, static, self._settings)

    def close(self) -> None:
        """End the processes."""
        self._pool.close()
        self._readers.close()
        self._fetchers.close()
        self._indexers.close()

    def ask_of(
        self, media: Media, flipped: bool, work: Callable[..., Any], *arguments: Any
    ) -> PoolTask:
        """Have a function called with a frame, ``work(media, flipped, settings, *arguments)``.

        Its future may have the errors of ``decode_frame``.

        Raises:
            NotFoundError: The file is not there.
            OverloadedError: Too many wait.
        """

        def explain(error: ChildEnded) -> ReviewError:
            return refused_picture(frame_name(media), error)

        return self._readers.submit(
            work, media, flipped, self._settings, *arguments, explain=explain
        )

    def ask_to(self, work: Callable[..., Any], *arguments: Any) -> PoolTask:
        """Have a function called that reads frames itself, ``work(*arguments, settings)``.

        Its future may have ``ChildEnded``.

        Raises:
            OverloadedError: Too many wait.
        """
        return self._readers.submit(work, *arguments, self._settings)

    def _fetch(self, media: Media, *, bounded: bool) -> PoolTask | None:
        if media.frame is not None:
            return self._index(media, bounded=bounded)
        if not is_stored(media) or is_kept(media, self._settings):
            return None

        def explain(error: ChildEnded) -> ReviewError:
            return StorageError(f"{frame_name(media)} {error}", hint="Try again in a moment.")

        return self._fetchers.submit(
            fetch_frame, media, self._settings, explain=explain, bounded=bounded
        )

    def _index(self, media: Media, *, bounded: bool) -> PoolTask | None:
        if has_index(media, self._settings):
            return None

        def explain(error: ChildEnded) -> ReviewError:
            return refused_picture(frame_name(replace(media, frame=None)), error)

        with self._lock:
            running = self._indexing.get(media.path)
            if running is None:
                running = self._indexers.submit(
                    index_video, media, self._settings, explain=explain, bounded=bounded
                )
                self._indexing[media.path] = running
        running.future.add_done_callback(lambda _: self._indexing.pop(media.path, None))
        # Who waits may leave; the index is made all the same, for it takes long and is needed again.
        waiting = PoolTask(explain)
        running.future.add_done_callback(partial(_pass_on, waiting.future))
        return waiting

    def _submit(self, media: Media, width: int | None, flipped: bool, *, bounded: bool) -> PoolTask:
        def explain(error: ChildEnded) -> ReviewError:
            refusal = refused_picture(frame_name(media), error)
            if error.reason in REMEMBERED_SECONDS:
                self._remember(media, refusal, REMEMBERED_SECONDS[error.reason])
            return refusal

        return self._pool.submit(
            make_picture,
            media,
            width,
            flipped,
            self._settings,
            explain=explain,
            # Other widths of it may have waited while it was tried.
            begin=partial(self._require_untried, media),
            bounded=bounded,
        )

    def _require_untried(self, media: Media) -> None:
        """Raise the refusal of a frame that went beyond the allowance, while it is remembered."""
        with self._lock:
            refusal, until = self._refused.get(frame_stamp(media), (None, 0.0))
        if refusal is not None and monotonic() < until:
            raise refusal

    def _remember(self, media: Media, refusal: ReviewError, seconds: float) -> None:
        with self._lock:
            self._refused[frame_stamp(media)] = (refusal, monotonic() + seconds)
            while len(self._refused) > REMEMBERED:
                self._refused.popitem(last=False)


def _pass_on(waiting: Future[Any], done: Future[Any]) -> None:
    """Give what became of a task to one who waits for it."""
    if done.cancelled():
        waiting.cancel()
    elif waiting.set_running_or_notify_cancel():
        error = done.exception()
        if error is None:
            waiting.set_result(done.result())
        else:
            waiting.set_exception(error)


def refused_picture(name: str, error: ChildEnded) -> ReviewError:
    """What the end of a process over a picture says: of the picture, or of the machine."""
    if error.reason in ("killed", "told"):
        more = " Where it happens often, give more memory." if error.reason == "killed" else ""
        return OverloadedError(f"{name} {error}", hint=f"Try again in a moment.{more}")
    kind = ImageError if error.reason == "crash" else TooLargeError
    return kind(f"{name} {error}")


def make_picture(media: Media, width: int | None, flipped: bool, settings: Settings) -> SentPicture:
    """A picture, made in this process."""
    data = read_frame(media, width, flipped, settings)
    return SentPicture.of(content_type(data), data)


def index_video(media: Media, settings: Settings) -> bool:
    """Make the index of a video, in this process."""
    video_times(media, settings)
    return True


def ready() -> None:
    """What a process does that shall only be there: it has loaded what it needs."""
