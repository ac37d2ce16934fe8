"""One click followed through ISSIA's cameras: their own pictures, into which the annotated balls are painted.

ISSIA's film itself is not in the data: what it would show is not measured here (``tests.bench.rig_follow``).
"""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.bench.rig_follow import FILM, follow_stretches
from tests.real.conftest import ISSIA

pytestmark = pytest.mark.skipif(not (ISSIA / FILM).is_file(), reason=f"no real data in {ISSIA}")


def test_one_click_a_stretch_meets_the_next_annotated_balls(tmp_path: Path) -> None:
    met = follow_stretches(ISSIA, tmp_path, 1, others=True)
    assert met.clicks == 3 and met.asked == 300
    assert met.within(2) > 0.93 and met.within(5) > 0.95
    assert met.wrong < 0.02
