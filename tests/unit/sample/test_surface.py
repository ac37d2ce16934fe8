"""The compiled functions that draw grass, boards and stands."""

from __future__ import annotations

from typing import NamedTuple

from app.sample import surface


def test_classes_that_compiled_functions_take_keep_their_names() -> None:
    """Compiled code that an earlier version has cached names them, and could not be read otherwise."""
    taken = {
        name
        for name, value in vars(surface).items()
        if isinstance(value, type) and issubclass(value, tuple) and value is not NamedTuple
    }
    assert taken == {"ShadingCamera", "ShadingGrass", "ShadingStadium"}
