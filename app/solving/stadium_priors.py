"""Stadium priors: what is known of a pitch and a picture of which nobody said anything.

Professional pitches are about 105 x 68 m and differ by one to two metres; the Laws of the Game
allow far more. Grass is raised towards the middle, lines are painted by hand along strings.
"""

from __future__ import annotations

import numpy as np

SIZE_SIGMA_M = np.array([2.0, 1.0])
"""Standard deviations of length and width of professional pitches about 105 x 68 m, metres: those of the
twenty clubs of the Premier League in 2022/23 (fifteen have 105 m, the others 100 to 103.3)."""
LAWS_SIZE_SIGMA_M = np.array([6.0, 8.0])
"""The same of any pitch that the Laws allow, 90 to 120 by 45 to 90 m."""
AS_TAKEN = np.full(3, 1e-4)
"""Of the logarithm of the pixels' aspect, and of the shift of the axis right and down in half
diagonals, in a picture as it was taken."""
WARP_SIGMA = np.full(3, 0.15)
"""The same in a picture that may have been stretched (4:3 to 16:9: 0.29) or cropped."""
PAINT_SIZE_SIGMA_M = np.array([1.5, 0.5])
"""Standard deviations of length and width of the pitches that main cameras show, metres. Of the twenty of
the Premier League in 2022/23 fifteen are 105 m long and seventeen 68 m wide (from 105 x 68 m: 2.0 and 1.0 m);
UEFA and most other leagues ask for 105 x 68 m."""
CROWN_SIGMA_M = 0.04
"""How far the grass is raised along the middle between the touchlines, metres. Pitches are laid with a slope of
3 to 5 in a thousand at most; five real clips show 0.03 to 0.14 m, 0.04 m about their mean."""
INWARD_SIGMA_M = 0.06
"""How far the middle of the paint lies inside the plan, metres: half its width. The Laws measure
to the outer edges, the coordinates of markings here are those of the middle; real clips show 0.04 to 0.08 m."""
LINE_SIGMA_M = 0.03
"""How far a painted line lies from its place, each for itself, metres: real clips show 0.02 to 0.05 m."""
