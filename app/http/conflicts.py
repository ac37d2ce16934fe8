"""A change that came too late is answered with the state as it is now."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager

from pydantic import BaseModel

from app.errors import StaleRevisionError
from app.http.errors import StaleStateError


@contextmanager
def current_state(load: Callable[[], BaseModel]) -> Iterator[None]:
    """Turn a ``StaleRevisionError`` into one that carries the present document.

    Args:
        load: Reads the present document; called only when it is needed.
    """
    try:
        yield
    except StaleRevisionError as error:
        raise StaleStateError(error, load().model_dump_json()) from error
