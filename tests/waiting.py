"""How long tests wait for what happens in time."""

from __future__ import annotations

SECONDS = 120.0
"""What a machine that does much else may take for anything; who waits longer has found a fault."""
