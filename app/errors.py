"""The error tree: one base, and for each branch the sentence a reviewer would want to read.

    ReviewError
      InputError            the caller's data
        UnknownMarkingError
        DatasetFormatError  (path, record, field)
        UnsafePathError
        TooManyPointsError
        TooLargeError
        ImageError
      NotFoundError
      ConflictError
        StaleRevisionError  (current)
        SharedStationError  (station)
        HeldGroupError      (here)
      GeometryError
        DegenerateGeometryError
      StorageError          the disk or the database refuses
        BusyError           another process writes for longer than one waits
        DamagedError        the database is not what was written
      OverloadedError       more work waits than is taken
      ClusterError          the other machines that solve cannot
      AccessError           who asks may not
        NotLoggedInError    nobody has said who asks
        ForbiddenError      their role does not let them
        TooManyTriesError   (seconds)
    ShapeError(ValueError)  our own mistake, outside the tree
    JobCancelled            no error at all: somebody wants the work to end

Only ``http/errors.py`` knows which HTTP status belongs to which branch, and only ``cli.py`` which
exit code.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from difflib import get_close_matches
from types import MappingProxyType
from typing import Any, Self


def suggest_similar_name(name: str, known: Iterable[str]) -> str | None:
    """A question that offers the known name nearest to one that is unknown; None where none is near.

    Example:
        >>> suggest_similar_name("circle centre", ["Circle central", "Middle line"])
        'Did you mean "Circle central"?'
    """
    by_folded = {each.casefold(): each for each in known}
    found = get_close_matches(name.strip().casefold(), by_folded, n=1)
    return f'Did you mean "{by_folded[found[0]]}"?' if found else None


class ReviewError(Exception):
    """Base of everything that a caller can cause or must be told.

    Args:
        message: One sentence that says what is wrong.
        hint: What to do about it, when there is something to do.
        pointer: JSON pointer to the field of the request that is at fault.
    """

    def __init__(self, message: str, *, hint: str | None = None, pointer: str | None = None):
        super().__init__(message)
        self.message = message
        self.hint = hint
        self.pointer = pointer

    def __reduce__(self) -> tuple[Any, ...]:
        """Travels from one process to another, with the disk's own error where it has one."""
        cause = self.__cause__ if isinstance(self.__cause__, OSError) else None
        return type(self)._rebuild_from_pickle, (self.args, vars(self), cause)

    @classmethod
    def _rebuild_from_pickle(
        cls, args: tuple[Any, ...], values: dict[str, Any], cause: OSError | None
    ) -> Self:
        error = cls.__new__(cls, *args)
        vars(error).update(values)
        error.__cause__ = cause
        return error


class InputError(ReviewError):
    """The caller's data cannot be used as it is."""


class UnknownMarkingError(InputError):
    """A marking name that is none of the 26 markings of the pitch."""

    def __init__(self, marking: str, known: Iterable[str] = ()):
        meant = suggest_similar_name(marking, known)
        where = "docs/glossary.md lists the 26 names; trailing spaces do not matter."
        super().__init__(
            f'"{marking}" is not a pitch marking', hint=f"{meant} {where}" if meant else where
        )
        self.marking = marking


class DatasetFormatError(InputError):
    """A file, or a record in it, that is not what its format says.

    Args:
        path: File as the user knows it (inside an archive: ``archive.zip/member``).
        record: Which record of the file (an image name, a frame, a line), or None for the file.
        field: Which field of the record, or None.
        problem: What is wrong, in words.
    """

    def __init__(self, path: str, record: str | None, field: str | None, problem: str):
        place = ", ".join(part for part in (path, record, field) if part)
        super().__init__(f"{place}: {problem}")
        self.path = path
        self.record = record
        self.field = field
        self.problem = problem


class UnsafePathError(InputError):
    """A path that would leave the folder it belongs to."""


class TooManyPointsError(InputError):
    """Lines of so many points that nobody drew them by hand."""


class TooLargeError(InputError):
    """More bytes, pixels or members than the limits in Settings allow."""


class ImageError(InputError):
    """Bytes that are not an image of an accepted kind."""


class NotFoundError(ReviewError):
    """Nothing of that name or number exists."""

    @classmethod
    def group(cls, group_id: int) -> Self:
        """That there is no such group."""
        return cls(f"there is no group {group_id}")

    @classmethod
    def person(cls, person_id: int) -> Self:
        """That there is nobody of that id."""
        return cls(f"there is no account with id {person_id}")

    @classmethod
    def dataset(cls, name: str | int, known: Mapping[int, str] | None = None) -> Self:
        """That there is no such dataset; ``known`` are those that there are, names by id.

        Whoever shows the error shows the near ones of those that its reader may see.
        """
        error = cls(f'there is no dataset "{name}"')
        error.asked, error.known = str(name), known or {}
        return error

    asked: str = ""
    known: Mapping[int, str] = MappingProxyType({})

    def suggest_nearest_name(self, sees: Callable[[int], bool] = lambda _: True) -> str | None:
        """A question whether another one was meant, of those that somebody may see."""
        return suggest_similar_name(
            self.asked, [name for key, name in self.known.items() if sees(key)]
        )


class ConflictError(ReviewError):
    """The request does not fit the present state."""


class StaleRevisionError(ConflictError):
    """The group (or station) was changed by somebody else first.

    Args:
        base_etag: The state the caller built on.
        current_etag: The state as it is now.
    """

    def __init__(self, message: str, *, base_etag: str, current_etag: str):
        super().__init__(message, hint="Load the current state and apply the change again.")
        self.base_etag = base_etag
        self.current_etag = current_etag


class SharedStationError(ConflictError):
    """What belongs to a static camera is edited on its station, not on one of its views.

    Args:
        view: Key of the view.
        station: Id of the station.
        station_key: Its key.
        what: What belongs to it: ``lines``, or ``picture``, which a static camera has none of.
    """

    def __init__(self, view: str, station: int, station_key: str, what: str = "lines"):
        message = f"view {view} has no lines of its own: it uses those of camera {station_key}"
        hint = f"Edit the lines of static camera {station} instead."
        if what != "lines":
            message = (
                f"the picture geometry of view {view} cannot be set: the view belongs to the"
                f" static camera {station_key}"
            )
            hint = "Correct the given camera of the static camera instead."
        super().__init__(message, hint=hint)
        self.station = station


class HeldGroupError(ConflictError):
    """Somebody else has a group of a batch open.

    Args:
        message: Names them.
        here: Everybody who has it open, with ``person`` and ``since``.
    """

    def __init__(self, message: str, here: Sequence[Any]):
        super().__init__(message, hint="Take the group over, or continue with the next one.")
        self.here = here


class GeometryError(ReviewError):
    """Geometry that has no answer; recorded on the solution, not a crash."""


class DegenerateGeometryError(GeometryError):
    """The input does not determine the result."""


class StorageError(ReviewError):
    """The disk or the database refuses; what was acknowledged before is safe."""


class BusyError(StorageError):
    """Another process writes for longer than one waits."""


EXAMINE = "Run touchline doctor: it reports what is damaged and how to restore a backup."
"""What to do about a damaged database."""


class DamagedError(StorageError):
    """The database is not what was written, or not the one of its home: nothing is written to it."""


class OverloadedError(ReviewError):
    """The server has as much work as it takes; later it takes more."""


class ClusterError(ReviewError):
    """The processes that solve on other machines are not there, or are not of this version."""


class AccessError(ReviewError):
    """The person who sends the request lacks the permission."""


class NotLoggedInError(AccessError):
    """The request has no login, or its session has ended."""


class ForbiddenError(AccessError):
    """The role of who asks does not let them."""


class TooManyTriesError(AccessError):
    """Too many tries to log in.

    Args:
        seconds: After so many the next one is looked at.
    """

    def __init__(self, seconds: int):
        super().__init__(
            "too many tries to log in", hint=f"Wait {seconds} seconds, then try again."
        )
        self.seconds = seconds


class JobCancelled(Exception):  # noqa: N818
    """The job shall end here: a person cancelled it, the server stops, or what the job is about is gone, which its text says."""


class ShapeError(ValueError):
    """An array of the wrong shape: a mistake in our own code."""
