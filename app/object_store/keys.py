"""The keys of a store, as the operator gives them."""

from __future__ import annotations

import configparser
from typing import TYPE_CHECKING

from app.errors import StorageError
from app.object_store.refusal import OPERATOR
from app.private_file import is_open_to_others

if TYPE_CHECKING:
    from app.config import StoreSettings


def read_keys(settings: StoreSettings) -> tuple[str, ...] | None:
    """Access key, secret and token, or None of a public store.

    They are read anew each time, for keys in a file are changed there.

    Raises:
        StorageError: The file of keys cannot be used.
    """
    if settings.anonymous:
        return None
    if settings.key_file is not None:
        return _keys_of_file(settings)
    given = (settings.key, settings.secret, settings.token)
    return tuple("" if value is None else value.get_secret_value() for value in given)


def _keys_of_file(settings: StoreSettings) -> tuple[str, ...]:
    path, parser = settings.key_file, configparser.ConfigParser(interpolation=None)
    assert path is not None
    try:
        if is_open_to_others(path.stat()):
            raise StorageError(
                "other users can read the file of a store's keys",
                hint=f"Run chmod 600 {path.name}.",
            )
        parser.read_string(path.read_text("utf-8"))
        section = parser[settings.profile]
        return (
            section["aws_access_key_id"],
            section["aws_secret_access_key"],
            section.get("aws_session_token", ""),
        )
    except (OSError, KeyError, UnicodeDecodeError, configparser.Error):
        # The text of the file is in no message.
        raise StorageError("the file of a store's keys cannot be read", hint=OPERATOR) from None
