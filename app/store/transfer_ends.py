"""Ends of a transfer: which databases are meant by what somebody typed."""

from __future__ import annotations

import re
from pathlib import Path

from app.config import Settings
from app.errors import InputError
from app.private_file import read_private

_PASSWORD = re.compile(r"://[^:/@]*:[^@]*@|[?&]password=")
"""In the address of a database, as its driver reads it."""


def ends_of(source: str, target: str, settings: Settings) -> tuple[Settings, Settings]:
    """Settings of the database that is copied, and of the one that it is copied to.

    Args:
        source: A home folder, the address of a database, or a file that holds one.
        target: The same.
        settings: Everything else.

    Raises:
        InputError: An address has a password that everybody could read, others than its owner may
            use a file, or it holds no address.
    """
    begin = _database(source, "FROM", settings)
    # The files of a home that goes into a database stay in that home.
    into = settings if _address(target, "TO") is None else begin
    return begin, _database(target, "TO", into)


def _database(place: str, name: str, settings: Settings) -> Settings:
    address = _address(place, name)
    if address is not None:
        return settings.model_copy(update={"database_url": address})
    return settings.model_copy(update={"home": Path(place).absolute(), "database_url": None})


def _address(place: str, name: str) -> str | None:
    """The address that an argument is, or that the file holds which it names; None: it is a home."""
    if "://" in place:
        if _PASSWORD.search(place):
            raise InputError(
                f"everybody on this machine can read the password in {name} while this runs",
                hint="Write the address into a file, chmod 600 it, and name that file instead.",
            )
        return place
    file = Path(place)
    if not file.is_file():
        return None
    address = read_private(file, name)
    if "://" not in address:
        raise InputError(
            f"{file} holds no address of a database",
            hint="Write postgresql://USER:PASSWORD@HOST/DATABASE into it, or name a home folder.",
        )
    return address
