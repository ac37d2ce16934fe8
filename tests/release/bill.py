"""Bill of materials: every library that comes with the product, as CycloneDX."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

from packaging.utils import canonicalize_name

from tests.release.libraries import EXTRAS, ROOT, closure

Bill = dict[str, Any]
ROOT_REF = "root-component"


def write_bill(out: Path, tools: Path) -> None:
    """Write one bill for both halves of the product.

    Args:
        out: The file.
        tools: Folder of the program ``cyclonedx-py``.
    """
    bill = merged(_python_bill(tools), _browser_bill())
    out.write_text(json.dumps(bill, indent=1, sort_keys=True) + "\n", encoding="utf-8")


def merged(python: Bill, browser: Bill) -> Bill:
    """The bill of the Python half, without what only developers install, and the browser's half."""
    required, optional = closure(), closure(EXTRAS)
    kept = [item for item in python["components"] if canonicalize_name(item["name"]) in optional]
    for item in kept:
        name = canonicalize_name(item["name"])
        item["scope"] = "required" if name in required else "optional"
    components = [_without_addresses(item) for item in (*kept, *browser["components"])]
    there = {item["bom-ref"] for item in components}
    first = {ROOT_REF: ROOT_REF, browser["metadata"]["component"]["bom-ref"]: ROOT_REF}
    edges: dict[str, set[str]] = {}
    for item in (*python["dependencies"], *browser["dependencies"]):
        ref = first.get(item["ref"], item["ref"])
        if ref in there or ref == ROOT_REF:
            edges.setdefault(ref, set()).update(there & set(item.get("dependsOn", ())))
    return {
        "$schema": python["$schema"],
        "bomFormat": python["bomFormat"],
        "specVersion": python["specVersion"],
        "version": 1,
        "metadata": {"component": _without_addresses(python["metadata"]["component"])},
        "components": components,
        "dependencies": [
            {"ref": ref, "dependsOn": sorted(needed)} for ref, needed in sorted(edges.items())
        ],
    }


def _without_addresses(component: Bill) -> Bill:
    """A package URL names a library; where somebody fetched it from is nobody's matter."""
    return {name: value for name, value in component.items() if name != "externalReferences"}


def _python_bill(tools: Path) -> Bill:
    program = [tools / "cyclonedx-py", "environment", "--pyproject", ROOT / "pyproject.toml"]
    return _told([*program, "--output-reproducible", "--of", "JSON", sys.executable])


def _browser_bill() -> Bill:
    npm = Path(sys.executable).with_name("npm")
    choice = ["--sbom-format", "cyclonedx", "--omit", "dev", "--package-lock-only"]
    return _told([npm, "--prefix", ROOT / "static", "sbom", *choice])


def _told(command: list[str | Path]) -> Bill:
    done = subprocess.run(command, cwd=ROOT / "static", capture_output=True, text=True, check=False)
    if done.returncode:
        raise RuntimeError(f"{command[0]}: {done.stderr}")
    bill: Bill = json.loads(done.stdout)
    return bill
