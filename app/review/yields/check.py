"""Whether the tables that yields are counted from are what was written."""

from __future__ import annotations

from pathlib import Path

from app.config import Settings
from app.plural import plural
from app.review.doctor.check import Check
from app.review.yields.arrays_file import map_arrays
from app.review.yields.cache import ARRAYS


def examine_yields(settings: Settings) -> Check:
    """Read every file of the cache; one that a server deletes meanwhile is none any more."""
    files = [path for ending in ARRAYS for path in sorted(settings.yields.glob(f"*/*{ending}"))]
    damaged = [path for path in files if not _is_sound(path)]
    if damaged:
        more = "" if len(damaged) == 1 else f" and {plural(len(damaged) - 1, 'other')}"
        sentence = f"{damaged[0].relative_to(settings.home)}{more} cannot be read as written"
        mend = f"Stop the server and delete {settings.yields}: yields are counted anew."
        return Check("yields", False, sentence, mend)
    count = plural(len(files), "file")
    return Check("yields", True, f"{count} in the cache, each as it was written")


def _is_sound(path: Path) -> bool:
    try:
        map_arrays(path, whole=True)
    except FileNotFoundError:
        return True
    except (OSError, ValueError, KeyError, TypeError):
        return False
    return True
