"""Programs that tests need of the system: installed from Debian's packages where this user may."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys


def install(package: str) -> None:
    """Install a package; nothing where there is no apt-get, or this user may not."""
    if shutil.which("apt-get") is None or os.geteuid() != 0:
        return
    sys.stdout.write(f"Installing {package} from the system's packages\n")
    if not _run("install", "-y", "--no-install-recommends", package):
        # Package lists may be missing or old.
        _run("update")
        _run("install", "-y", "--no-install-recommends", package)


def _run(*arguments: str) -> bool:
    environment = {**os.environ, "DEBIAN_FRONTEND": "noninteractive"}
    done = subprocess.run(
        ["apt-get", *arguments], env=environment, check=False, capture_output=True
    )
    return done.returncode == 0
