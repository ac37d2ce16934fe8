"""COCO: names that its reader and its writer share."""

from __future__ import annotations

STATE = "touchline"
"""The extra field of an image that holds everything that was said of its view."""
CAMERA = "camera"
"""The field of an image that holds its camera as SoccerNet spells it."""
PREFIX, OUTSIDE = "instances_", "outside_"
"""Of the files with the images from which a detector learns, and of those with all others."""
