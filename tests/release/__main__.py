"""What has to be known and made before others install the product: see the Makefile.

    python -m tests.release licences                 # of all pinned libraries; offline
    python -m tests.release advisories TOOLS         # published weaknesses of them
    python -m tests.release build OUT TOOLS          # sdist, wheel, lock, bill of materials, sums

TOOLS is the folder of the programs pip-audit and cyclonedx-py.
"""

from __future__ import annotations

import hashlib
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from app.formats.manifest import read_software_version
from tests.release.advisories import ask_browser, ask_python
from tests.release.bill import write_bill
from tests.release.libraries import EXTRAS, ROOT, closure, pins
from tests.release.licences import complaints
from tests.release.sources import unpack

SUMS = "SHA256SUMS"


def tell_licences() -> int:
    """Print what is wrong with the libraries' licences; 1 if anything is."""
    found = complaints()
    print("\n".join(found) or "Every pinned library has an allowed licence.")
    return 1 if found else 0


def tell_advisories(tools: Path) -> int:
    """Print what the services know; 1 if one knows of a weakness. Silence is no failure."""
    answers = (ask_python(tools), ask_browser())
    for answer in answers:
        print(answer.sentence)
    return 1 if any(answer.weak for answer in answers) else 0


def build(out: Path, tools: Path) -> int:
    """Make everything that a release consists of, in a folder of its own; 1 where it cannot be."""
    if not _emptied(out):
        print(f"{out} holds something else than a release. Name an empty folder.", file=sys.stderr)
        return 1
    for target in ("sdist", "wheel"):
        _build(ROOT, out, target)
    if not _same_again(out):
        print("The source distribution builds another wheel than the checkout.", file=sys.stderr)
        return 1
    name = f"touchline-{read_software_version()}"
    write_lock(out / "requirements.txt")
    write_lock(out / "requirements-all.txt", *EXTRAS)
    write_bill(out / f"{name}.cdx.json", tools)
    files = sorted(path for path in out.iterdir() if path.name != SUMS)
    sums = [f"{hashlib.sha256(path.read_bytes()).hexdigest()}  {path.name}\n" for path in files]
    (out / SUMS).write_text("".join(sums), encoding="utf-8")
    print("".join(sums), end="")
    return 0


def _emptied(out: Path) -> bool:
    """Make a folder empty that is there for a release; False for any other, which stays."""
    if out.is_dir() and any(out.iterdir()):
        if not (out / SUMS).is_file():
            return False
        shutil.rmtree(out)
    elif out.exists() and not out.is_dir():
        return False
    out.mkdir(parents=True, exist_ok=True)
    return True


def _build(project: Path, out: Path, target: str) -> None:
    command = [sys.executable, "-m", "hatchling", "build", "-t", target, "-d", str(out)]
    subprocess.run(command, cwd=project, check=True, stdout=subprocess.DEVNULL)


def _same_again(out: Path) -> bool:
    """Whether the source distribution builds the wheel beside it, byte for byte."""
    with tempfile.TemporaryDirectory(prefix="touchline-release-") as name:
        folder = Path(name)
        project = unpack(next(out.glob("*.tar.gz")), folder / "sources")
        _build(project, folder, "wheel")
        one, other = next(out.glob("*.whl")), next(folder.glob("*.whl"))
        return one.name == other.name and one.read_bytes() == other.read_bytes()


def write_lock(out: Path, *extras: str) -> None:
    """Write the entries of requirements.lock that an installation with these extras needs."""
    needed = closure(extras)
    out.write_text("".join(f"{pin.text}\n" for pin in pins() if pin.name in needed), "utf-8")


def main(words: list[str]) -> int:
    """Do what the words ask for."""
    match words:
        case ["licences"]:
            return tell_licences()
        case ["advisories", tools]:
            return tell_advisories(Path(tools))
        case ["build", out, tools]:
            return build(Path(out).resolve(), Path(tools).resolve())
    print(__doc__)
    return 2


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
