"""``make mutate``: how many small faults in the arithmetic of gates and balls the tests find.

Faults are planted one by one by mutmut in the modules that ``pyproject.toml`` names; a fault
that no test finds survives; ``python -m mutmut show NAME`` prints it. Some change nothing and
cannot be found: ``strict=False`` for lengths that are always equal, one coordinate of a pixel
instead of the other where both are NaN together, ``max`` without its key.
"""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from pathlib import Path

from tests.bench.table import print_table

MUTANTS = Path("mutants")
ENOUGH = 0.9
"""Share of the faults in each module that the tests must find."""
_SURVIVED = (0, 5, 33)
"""Exit codes of a run that found nothing, or had no test to run."""


def main() -> int:
    """Plant the faults, run the tests, print what survived; 1 where too much did."""
    shutil.rmtree(MUTANTS, ignore_errors=True)
    subprocess.run([sys.executable, "-m", "mutmut", "run", "--max-children", "2"], check=True)
    rows, survivors = [], []
    for path in sorted(MUTANTS.rglob("*.py.meta")):
        codes = json.loads(path.read_text())["exit_code_by_key"]
        alive = [name for name, code in codes.items() if code in _SURVIVED]
        if codes:
            module = str(path.relative_to(MUTANTS)).removesuffix(".meta")
            killed = len(codes) - len(alive)
            rows.append((module, killed, len(alive), killed / len(codes)))
            survivors += alive
    print_table("Planted faults", ("module", "killed", "survived", "share killed"), rows)
    print("", *survivors, sep="\n")
    return 0 if rows and min(row[3] for row in rows) >= ENOUGH else 1


if __name__ == "__main__":
    sys.exit(main())
