"""What a store refuses, in sentences without keys, buckets or endpoints."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from app.errors import InputError, NotFoundError, StorageError

OPERATOR = "Ask the operator: touchline doctor says what is wrong with a store."
_CODE = re.compile(r"<Code>(\w{1,60})</Code>")
_KEYS_REFUSED = frozenset(
    {"AccessDenied", "ExpiredToken", "InvalidAccessKeyId", "InvalidToken", "SignatureDoesNotMatch", "TokenRefreshRequired"}
)  # fmt: skip


class ChangedObjectError(NotFoundError):
    """The object is not the one that was meant any more."""


@contextmanager
def told(store: str, address: str, wrong: Any) -> Iterator[None]:
    """Say in our words what a store answered.

    Args:
        store: Its name.
        address: What it was asked for, as people call it.
        wrong: The errors of the library that speaks to it.

    Raises:
        ChangedObjectError, NotFoundError: The object is another, or not there.
        InputError: It cannot be the address of an object.
        StorageError: The store cannot be asked, or refuses.
    """
    try:
        yield
    except FileNotFoundError as error:
        raise NotFoundError(f"{address} is not in its store") from error
    except wrong.PreconditionError as error:
        raise ChangedObjectError(
            f"{address} was changed in its store since it was imported",
            hint="Import it again to take the new one, or put the old one back.",
        ) from error
    except (wrong.BaseError, OSError) as error:
        raise _refusal(store, error, wrong) from error
    except ValueError as error:
        raise InputError(f"{address} cannot be the address of an object") from error


def _refusal(name: str, error: Exception, wrong: Any) -> StorageError:
    """What a store that cannot be asked is said to be."""
    found = _CODE.search(str(error))
    code = f" ({found[1]})" if found else ""
    denied = isinstance(error, wrong.PermissionDeniedError | wrong.UnauthenticatedError)
    if denied or (found and found[1] in _KEYS_REFUSED):
        return StorageError(
            f'the store "{name}" refuses the keys of this server{code}', hint=OPERATOR
        )
    if code:
        return StorageError(f'the store "{name}" cannot do what it was asked{code}', hint=OPERATOR)
    return StorageError(
        f'the store "{name}" cannot be reached, or does not answer in time',
        hint="Try again in a moment. " + OPERATOR,
    )
