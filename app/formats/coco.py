"""COCO: names that its reader and its writer share."""

from __future__ import annotations

STATE = "touchline"
"""The extra field of an image that holds everything that was said of its view."""
CAMERA = "camera"
"""The field of an image that holds its camera as SoccerNet spells it."""
ORIGIN, CORNER = "bbox_origin", "corner"
"""Says in that block, and in the file's ``info``, that boxes are measured from the corner of the
first pixel; files of before, whose boxes are in our own pixel frame, do not say it."""
PREFIX, OUTSIDE = "instances_", "outside_"
"""Of the files with the images from which a detector learns, and of those with all others."""
