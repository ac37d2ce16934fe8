"""The door of the command line."""

from __future__ import annotations

import subprocess
import sys


def test_who_only_opens_it_loads_no_command():
    asked = "import sys, app.cli; print(sorted({'typer', 'numpy', 'app.command_line'} & set(sys.modules)))"
    said = subprocess.run([sys.executable, "-c", asked], capture_output=True, text=True, check=True)
    assert said.stdout == "[]\n"
