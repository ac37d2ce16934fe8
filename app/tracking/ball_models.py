"""What a ball does by itself, and what touches and grass do to it: the numbers of the models."""

from __future__ import annotations

GRAVITY = 9.81
"""Metres per second squared; z points down."""
DRAG = 0.0115
"""Of a size 5 ball in air, per metre: half of density, area and coefficient (0.21) by mass."""
REST = 0.113
"""Height of the centre of a ball that lies on the grass, metres."""
ROLLING = 0.7
"""Deceleration of a rolling ball, m/s2."""
RESTITUTION, RESTITUTION_SIGMA = 0.6, 0.1
"""Share of the vertical speed that is left after a bounce."""
KEPT, KEPT_SIGMA = 0.75, 0.12
"""Share of the horizontal velocity that is left after a bounce, spin making it more or less."""
KICK_SPEED, KICK_LIFT = 12.0, 5.0
"""Standard deviation of each horizontal component, and of the vertical one, after a kick, m/s."""
TOUCH_SPEED = 6.0
"""Change of each horizontal component by a touch after which the ball rolls on, m/s."""
KICKS_A_SECOND, HOLDS_A_SECOND = 0.6, 0.05
"""How often a ball is touched, and taken into somebody's keeping."""
LEAST_CHANGE = 2.5
"""Of the velocity by what is called an event; hops of a rolling ball are less, m/s."""
TOUCHED, TOUCHED_SIGMA = 0.9, 0.9
"""Height at which a ball in the air is touched: by feet mostly, by heads at twice that, metres."""
JUMP_SHARE, JUMP_SIGMA = 0.1, 0.7
"""How often other cameras contradict those before, and how far each coordinate is off then, metres."""
REACH = 2.7
"""Height above which nobody but a keeper touches a ball, metres."""
GRASS_SIGMA = 0.12
"""Height of a rolling ball above and below rest: blades, ruts, hops and what the pitch is off, metres."""
GRASS_S = 2.0
"""How long a rolling ball keeps such a height, seconds."""
SPIN_SHARE, SPIN_LEAST, SPIN_S = 0.5, 0.2, 2.5
"""Acceleration by spin as a share of the drag, what wind adds in m/s2, and how long both last, s."""
ROLL_SIGMA, ROLL_S = 1.5, 0.4
"""Acceleration of a rolling ball beside its deceleration (skids, ruts, feet that run along)."""
HELD_SIGMA, HELD_S = 12.0, 0.25
"""Acceleration of a ball in somebody's keeping, and how long it lasts."""

FLIGHT, ROLL, HELD = 0, 1, 2
"""Modes of the search, by number."""
NOTHING, KICK, BOUNCE, JUMP = 0, 1, 2, 3
"""What happens between two instants, by number; a bounce into a roll is a landing, and a jump is of no
ball: other cameras see it from then on, which are not exact."""
