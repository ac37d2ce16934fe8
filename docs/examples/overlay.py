"""Draw the pitch onto a frame: python overlay.py SOURCE [OUT.png]

SOURCE is an export (folder or zip of `touchline export --format parquet`) or the address of a server.
"""

import sys

import matplotlib.pyplot as plt
import numpy as np

import touchline

source, out = sys.argv[1], sys.argv[2] if len(sys.argv) > 2 else "overlay.png"
version = touchline.open(source)
view = next(view for view in version.views if view.camera and view.ball_3d)
plt.imshow(view.image())
for x in np.arange(-52.5, 53, 5.25):
    line = np.column_stack([np.full(200, x), np.linspace(-34, 34, 200), np.zeros(200)])
    plt.plot(*view.camera.project(line).T, color="cyan", linewidth=0.7)
plt.plot(*view.camera.project(view.ball_3d.position), "o", color="red", fillstyle="none")
plt.xlim(-0.5, view.width - 0.5)
plt.ylim(view.height - 0.5, -0.5)
plt.savefig(out, dpi=150)
print(f"{view.key}: the ball lies {view.ball_3d.height_m:.2f} m above the grass; see {out}")
