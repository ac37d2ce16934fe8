"""Options: from what was typed, or set in the environment, to values; wrong ones are wrong usage."""

from __future__ import annotations

import re
from contextvars import ContextVar
from typing import TYPE_CHECKING, Annotated, Any, get_args

import typer

from app.soccer.actors import LOCAL_USER, parse_script_name
from app.soccer.choices import PolicyName
from app.soccer.frames import ImageSize

if TYPE_CHECKING:
    from pathlib import Path

    from app.config import Settings

POLICY_OR_FILE = "|".join((*get_args(PolicyName), "FILE.yaml"))


def parse_size(text: str) -> ImageSize:
    """A size as it is typed: ``960x540``."""
    match = re.fullmatch(r"([1-9]\d{0,4})[xX]([1-9]\d{0,4})", text)
    if match is None:
        raise typer.BadParameter(f'"{text}" is not a size; write it as 960x540')
    return ImageSize(int(match[1]), int(match[2]))


def parse_cameras(text: str) -> frozenset[int]:
    """Numbers of cameras as they are typed: ``2,6``."""
    parts = [part.strip() for part in text.split(",") if part.strip()]
    if not all(part.isascii() and part.isdigit() for part in parts):
        raise typer.BadParameter(f'"{text}" is not a list of cameras; write it as 2,6')
    return frozenset(int(part) for part in parts)


def parse_frame_offset(text: str) -> int | dict[int, int]:
    """A frame offset as it is typed: ``8``, or ``1=8,2=9`` (also ``1:8,2:9``) by camera."""
    if re.fullmatch(r"-?\d{1,6}", text):
        return int(text)
    pairs = [re.fullmatch(r"(\d{1,3})[=:](-?\d{1,6})", part.strip()) for part in text.split(",")]
    found = [(int(pair[1]), int(pair[2])) for pair in pairs if pair]
    if len(found) < len(pairs):
        raise typer.BadParameter(f'"{text}" is not an offset; write 8, or 1=8,2=9 by camera')
    return dict(found)


def parse_path_or_store_address(text: str) -> str:
    """A folder or file that is there, or an address in an object store."""
    from pathlib import Path

    if not text.startswith("s3://") and not Path(text).exists():
        raise typer.BadParameter(f"Path '{text}' does not exist.")
    return text


def get_current_actor() -> str:
    """The actor of this command: the local user, or the script that `--actor` names."""
    return _ACTING.get()


def set_current_actor(name: str | None) -> None:
    """Let this command act under the name of a script; None: as the local user.

    Raises:
        InputError: It cannot be a name.
    """
    _ACTING.set(LOCAL_USER if name is None else parse_script_name(name))


_ACTING = ContextVar("acting", default=LOCAL_USER)


Dataset = Annotated[str, typer.Option("--dataset", help="Name of the dataset.")]
Json = Annotated[bool, typer.Option("--json", help="Print one JSON document on stdout.")]
Size = Annotated[
    ImageSize,
    typer.Option(
        "--size",
        parser=parse_size,
        metavar="WxH",
        default_factory=lambda: "960x540",
        show_default="960x540",
        help="Size of the annotated images.",
    ),
]
Workers = Annotated[
    int | None, typer.Option("--workers", min=1, help="Processes; default: all cores.")
]

Cluster = Annotated[
    str | None,
    typer.Option(
        "--cluster",
        metavar="ADDRESS",
        help="Scheduler whose workers solve, such as tls://HOST:8786. [env: TOUCHLINE_CLUSTER]",
    ),
]


def read_text(path: Path, most: int) -> str:
    """The text of a file that an option names, cut off after one character too many.

    Raises:
        InputError: It cannot be read, or is not UTF-8.
    """
    from app.errors import InputError

    try:
        if not path.is_file():
            raise InputError(f"{path} is not a regular file")
        with path.open(encoding="utf-8") as file:
            return file.read(most + 1)
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{path} cannot be read as text") from error


def read_settings(**given: object) -> Settings:
    """Settings from the environment and, stronger, from the command line."""
    from pydantic import ValidationError
    from pydantic_settings import SettingsError

    from app.config import Settings

    values: dict[str, Any] = {name: value for name, value in given.items() if value is not None}
    try:
        return Settings(**values)
    except ValidationError as error:
        first = error.errors()[0]
        name = "_".join(str(part) for part in first["loc"]).upper()
        raise typer.BadParameter(f"{first['msg']} (TOUCHLINE_{name})") from None
    except SettingsError as error:
        raise typer.BadParameter(_describe_json_problem(str(error))) from None


def _describe_json_problem(error: str) -> str:
    """What is wrong with a variable that should hold JSON; nothing of what it holds, maybe a secret."""
    from app.config import Settings

    found = re.search(r'field "(\w+)"', error)
    if found is None:
        return "a variable TOUCHLINE_... should hold JSON, and does not"
    several = isinstance(Settings.model_fields[found[1]].get_default(), list)
    example = '["ONE", "ANOTHER"]' if several else '{"NAME": {...}}'
    return f"TOUCHLINE_{found[1].upper()} is not JSON; write it as {example}"
