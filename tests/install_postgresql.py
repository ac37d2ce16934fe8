"""Make sure that the tests have a PostgreSQL: install it, find one, or say what to do."""

from __future__ import annotations

import os
import sys

from tests.cluster import ADVICE, find_programs
from tests.system_packages import install

if __name__ == "__main__":
    if find_programs() is None:
        install("postgresql")
    if find_programs() is None:
        # Who may not install it has the tests on PostgreSQL skipped, with the same words.
        print(ADVICE, file=sys.stderr)
        sys.exit(os.geteuid() == 0)
