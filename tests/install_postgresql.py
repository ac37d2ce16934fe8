"""Make sure that the tests have a PostgreSQL: install it, find one, or say what to do."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys

from tests.cluster import ADVICE, find_programs


def install() -> None:
    """Install PostgreSQL from the system's packages, where this user may."""
    if shutil.which("apt-get") is None or os.geteuid() != 0:
        return
    print("Installing PostgreSQL from the system's packages", flush=True)
    if not _run("install", "-y", "--no-install-recommends", "postgresql"):
        # Package lists may be missing or old.
        _run("update")
        _run("install", "-y", "--no-install-recommends", "postgresql")


def _run(*arguments: str) -> bool:
    environment = {**os.environ, "DEBIAN_FRONTEND": "noninteractive"}
    done = subprocess.run(
        ["apt-get", *arguments], env=environment, check=False, capture_output=True
    )
    return done.returncode == 0


if __name__ == "__main__":
    if find_programs() is None:
        install()
    if find_programs() is None:
        # Who may not install it has the tests on PostgreSQL skipped, with the same words.
        print(ADVICE, file=sys.stderr)
        sys.exit(os.geteuid() == 0)
