"""Stadium priors: what is known of a pitch and a picture of which nobody said anything.

Professional pitches are about 105 x 68 m and differ by one to two metres; the Laws of the Game
allow far more.
"""

from __future__ import annotations

import numpy as np

PAINT_SIZE_SIGMA_M = np.array([2.0, 1.0])
"""Standard deviations of length and width of professional pitches about 105 x 68 m, metres: those of the
twenty clubs of the Premier League in 2022/23 (fifteen have 105 m, the others 100 to 103.3)."""
LAWS_SIZE_SIGMA_M = np.array([6.0, 8.0])
"""The same of any pitch that the Laws allow, 90 to 120 by 45 to 90 m."""
AS_TAKEN = np.full(3, 1e-4)
"""Of the logarithm of the pixels' aspect, and of the shift of the axis right and down in half
diagonals, in a picture as it was taken."""
WARP_SIGMA = np.full(3, 0.15)
"""The same in a picture that may have been stretched (4:3 to 16:9: 0.29) or cropped."""
