"""Settings: the page of everything that can be set, from the code that reads it."""

from __future__ import annotations

import ast
import inspect
from itertools import pairwise
from pathlib import Path

from pydantic_core import PydanticUndefined

from app.config import Settings
from app.soccer.policy import STRICT
from app.soccer.thresholds import THRESHOLDS, Threshold

ROOT = Path(__file__).resolve().parents[2]
SETTINGS_PAGE = ROOT / "docs" / "settings.md"
COMPUTED = {
    "home": "`touchline` in the user's data folder",
    "workers": "the number of processors",
    "image_workers": "the number of processors, at most 4",
    "import_memory": "half of the memory, at most 4 GiB",
}
"""Defaults that depend on the machine."""
INTRO = """
Written from the code by `python -m tests.docs`.

## Of the installation
Environment variables, read by `touchline serve` and every command. [operations.md](operations.md) explains their use.
""".strip()
POLICY = """
## Of a dataset: the policy
The thresholds of the policy of a dataset: `touchline policy show`, the page *Policy*, or `PUT /datasets/{id}/policy`
([api.md](api.md)). Empty: not required. *paper* has the values of the paper; *strict* requires more where its column differs;
*touchline* is *paper* with `calibration.source` `paint` and `calibration.shortest_marking_px` 5.
""".strip()


def settings_page() -> str:
    """What docs/settings.md has to say."""
    rows = [
        f"| `TOUCHLINE_{name.upper()}` | {_default(name)} | {text} |" for name, text in _texts()
    ]
    thresholds = [
        f"| `{item.name}` | {item.label_with_unit} | {_value(item.default)} | {_value(item.value(STRICT))} | "
        f"{_range(item)} |"
        for item in THRESHOLDS
    ]
    parts = [
        "# Settings",
        INTRO,
        "\n".join(["| variable | default | meaning |", "|---|---|---|", *rows]),
        POLICY,
        "\n".join(
            ["| name | what | paper | strict | values |", "|---|---|---|---|---|", *thresholds]
        ),
    ]
    return "\n\n".join(parts) + "\n"


def _texts() -> list[tuple[str, str]]:
    """Names of the settings and the text that stands below each in the code."""
    body = ast.parse(inspect.getsource(Settings)).body[0].body  # type: ignore[attr-defined]
    found = []
    for item, text in pairwise(body):
        match item, text:
            case (
                ast.AnnAssign(target=ast.Name(id=name)),
                ast.Expr(value=ast.Constant(value=str(words))),
            ):
                found.append((name, " ".join(words.split()).replace("``", "`")))
    assert {name for name, _ in found} == set(Settings.model_fields)
    return found


def _default(name: str) -> str:
    value = Settings.model_fields[name].default
    if name in COMPUTED:
        return COMPUTED[name]
    assert value is not PydanticUndefined, f"say in COMPUTED what {name} is by default"
    if isinstance(value, int) and value >= 2**20 and value % 2**20 == 0:
        return f"`{value}` ({_bytes(value)})"
    return _value(value)


def _bytes(value: int) -> str:
    return f"{value // 2**30} GiB" if value % 2**30 == 0 else f"{value // 2**20} MiB"


def _value(value: object) -> str:
    if value is None or value == []:
        return ""
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, list):
        return " ".join(f"`{item}`" for item in value)
    return f"`{value}`"


def _range(item: Threshold) -> str:
    if item.has_word_choices:
        return ", ".join(f"`{choice}`" for choice in item.choices)
    if item.minimum is None:
        return "yes, no"
    return f"{item.minimum:g} to {item.maximum:g}"
