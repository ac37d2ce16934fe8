"""Plot the balls of a match in 3D, with the cameras that saw them: python plot_match.py SOURCE [OUT.png]"""

import sys

import matplotlib.pyplot as plt
import numpy as np

import touchline

source, out = sys.argv[1], sys.argv[2] if len(sys.argv) > 2 else "match.png"
version = touchline.open(source)
match = version.groups[0].match
groups = [group for group in version.groups if group.match == match and group.ball]
length, width = groups[0].pitch

axes = plt.figure(figsize=(9, 5)).add_subplot(projection="3d")
x, y = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1), (-1, -1)]).T
axes.plot(x * length / 2, y * width / 2, color="green")
axes.plot([0, 0], [-width / 2, width / 2], color="green")
for group in groups:
    ball_x, ball_y, _ = group.ball.position
    axes.scatter(ball_x, ball_y, group.ball.height_m, color="red", s=12)
    axes.plot([ball_x] * 2, [ball_y] * 2, [0, group.ball.height_m], color="red", linewidth=0.6)
    for view in group.views:
        if view.in_valid_pair:
            camera_x, camera_y, camera_z = view.camera.position
            axes.scatter(camera_x, camera_y, -camera_z, color="blue", marker="^", s=10)
axes.set(xlabel="x (m)", ylabel="y (m)", zlabel="height (m)", title=match.rsplit("/", 1)[-1])
axes.set_aspect("equal")
plt.savefig(out, dpi=150)
print(f"{len(groups)} balls of {match}: see {out}")
