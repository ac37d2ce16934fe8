"""sn-gamestate: names that its reader and its writer share."""

from __future__ import annotations

LABELS = "Labels-GameState.json"
METADATA = "gamestate"
"""Under this name ``Extras.metadata`` keeps what the file says besides lines and boxes."""
BALL, PITCH = "ball", "pitch"
BALL_ID, PITCH_ID = 4, 5
"""Ids of the categories where a file does not list them."""
