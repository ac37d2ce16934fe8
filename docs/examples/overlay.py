"""Draw the pitch and the ball onto a frame: python overlay.py SOURCE [OUT]

SOURCE is an export (folder or zip of `touchline export --format parquet`) or the address of a server.
"""

import sys

import matplotlib.pyplot as plt
import numpy as np

import touchline

source, out = sys.argv[1], sys.argv[2] if len(sys.argv) > 2 else "overlay.png"
version = touchline.open(source)
group = next(group for group in version if group.ball)
view = next(view for view in group.views if view.in_valid_pair)
half_length, half_width = group.pitch[0] / 2, group.pitch[1] / 2
areas = [(-half_length, half_length, half_width), (0, 0, half_width)]
for depth, width in ((16.5, 20.16), (5.5, 9.16)):  # penalty area and goal area
    areas += [
        (-half_length, depth - half_length, width),
        (half_length - depth, half_length, width),
    ]

figure = plt.figure(figsize=(view.width / 160, view.height / 160))
plt.axes((0, 0, 1, 1), xlim=(-0.5, view.width - 0.5), ylim=(view.height - 0.5, -0.5)).axis("off")
plt.imshow(view.image())
for left, right, width in areas:
    corners = np.array([(left, -width), (right, -width), (right, width), (left, width)])
    for start, end in zip(corners, np.roll(corners, 1, axis=0), strict=True):
        ground = np.linspace([*start, 0], [*end, 0], 300)  # x, y, z of points along the line
        plt.plot(*view.camera.project(ground).T, color="cyan", linewidth=1)
plt.plot(*view.camera.project(group.ball.position), "o", color="red", fillstyle="none")
figure.savefig(out, dpi=160)
print(f"{view.key}: the ball is {group.ball.height_m:.2f} m above the grass; see {out}")
