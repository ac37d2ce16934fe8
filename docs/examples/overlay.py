"""Draw the pitch and the ball onto a frame: python overlay.py SOURCE [OUT]

SOURCE is an export (folder or zip of `touchline export --format parquet`) or the address of a server.
"""

import sys

import matplotlib.pyplot as plt

import touchline

source, out = sys.argv[1], sys.argv[2] if len(sys.argv) > 2 else "overlay.png"
version = touchline.open(source)
group = next(group for group in version if group.ball)
view = next(view for view in group.views if view.in_valid_pair)

figure = plt.figure(figsize=(view.width / 160, view.height / 160))
plt.axes((0, 0, 1, 1), xlim=(-0.5, view.width - 0.5), ylim=(view.height - 0.5, -0.5)).axis("off")
plt.imshow(view.image())
for points in touchline.markings(*group.pitch).values():
    plt.plot(*view.camera.project(points).T, color="cyan", linewidth=1)
plt.plot(*view.camera.project(group.ball.position), "o", color="red", fillstyle="none")
figure.savefig(out, dpi=160)
print(f"{view.key}: the ball is {group.ball.height_m:.2f} m above the grass; see {out}")
