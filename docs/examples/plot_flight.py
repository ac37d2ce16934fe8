"""Plot the highest flight of a version in 3D, with its uncertainty: python plot_flight.py SOURCE [OUT.png]"""

import sys

import matplotlib.pyplot as plt
import numpy as np

import touchline

source, out = sys.argv[1], sys.argv[2] if len(sys.argv) > 2 else "flight.png"
version = touchline.open(source)
flights = [(track, rows) for track in version.tracks for rows in track.flights()]
if not flights:
    sys.exit(f"{version.name} has no track in which the ball flies")
track, rows = max(flights, key=lambda flight: float(np.nanmax(flight[0].height_m[flight[1]])))
x, y, height = track.position[rows, 0], track.position[rows, 1], track.height_m[rows]

axes = plt.figure(figsize=(9, 6)).add_subplot(projection="3d")
axes.plot(x, y, height, color="red", label="ball")
axes.plot(x, y, np.zeros(len(x)), color="grey", linewidth=0.8, label="below it")
around = np.stack(np.meshgrid(np.linspace(0, 2 * np.pi, 13), np.linspace(0, np.pi, 7)), axis=-1)
longitude, latitude = around[..., 0], around[..., 1]
sphere = np.stack(
    [np.cos(longitude) * np.sin(latitude), np.sin(longitude) * np.sin(latitude), np.cos(latitude)],
    axis=-1,
)
for row in range(rows.start, rows.stop, max((rows.stop - rows.start) // 12, 1)):
    # An ellipsoid of two sigma, its axes those of the covariance.
    values, directions = np.linalg.eigh(track.covariance[row, :3, :3])
    surface = track.position[row] + 2 * sphere * np.sqrt(values) @ directions.T
    axes.plot_wireframe(*np.moveaxis(surface * (1, 1, -1), -1, 0), color="red", linewidth=0.3)
for event in track.events:
    if track.times[rows.start] - 0.2 <= event.time_s <= track.times[rows.stop - 1] + 0.2:
        event_x, event_y, event_z = event.position
        axes.scatter(event_x, event_y, -event_z, marker="o", s=40)
        axes.text(event_x, event_y, -event_z, f" {event.kind}")
speed = np.linalg.norm(track.velocity[rows], axis=1)
title = f"{track.stretch}: {np.nanmax(height):.1f} m high, {3.6 * np.nanmax(speed):.0f} km/h"
axes.set(xlabel="x (m)", ylabel="y (m)", zlabel="height (m)", title=title)
axes.set_aspect("equal")
axes.legend()
plt.savefig(out, dpi=150)
sigma = float(np.nanmedian(track.sigma[rows]))
print(f"{title}; uncertainty {sigma:.2f} m in the middle of its frames; see {out}")
