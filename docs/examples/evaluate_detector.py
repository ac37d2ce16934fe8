"""Evaluate a detector: python evaluate_detector.py ADDRESS DATASET VERSION

Runs `detect` on every frame of a version, sends what it found, and prints the tables that Touchline makes
of it. Put your own detector into `detect`.
"""

import csv
import sys
import tempfile
from pathlib import Path

import numpy as np

import touchline

address, dataset, name = sys.argv[1:4]


def detect(image):
    """Boxes (x, y, width, height, score) in a frame: here, around its brightest pixel."""
    brightness = image.min(axis=2)
    y, x = np.unravel_index(brightness.argmax(), brightness.shape)
    return [(x - 6.0, y - 6.0, 12.0, 12.0, brightness[y, x] / 255)]


version = touchline.open(address, name, dataset=dataset)
with tempfile.TemporaryDirectory() as folder, touchline.Client(address) as client:
    file = Path(folder) / "boxes.csv"
    with file.open("w", newline="") as text:
        table = csv.writer(text)
        table.writerow(["image", "x", "y", "w", "h", "score"])
        for view in version.views:
            for box in detect(view.image()):
                table.writerow([f"{view.match}/{view.key}", *box])
    existing = client.get(f"datasets/{dataset}/predictions")["items"]
    found = client.post(
        f"datasets/{dataset}/predictions",
        {
            "name": f"brightest pixel {len(existing) + 1}",
            "format": "csv",
            "upload": client.upload(file),
        },
    )
    print(f"{found['boxes']} boxes in {found['frames']} frames, {found['unknown']} unknown")
    versions = client.get(f"datasets/{dataset}/versions")["items"]
    number = next(item["id"] for item in versions if item["hash"] == version.hash)
    job = client.post(
        f"datasets/{dataset}/evaluations", {"predictions": found["id"], "version": number}
    )
    done = client.wait(job)
    evaluation = client.get(f"evaluations/{done['result']['evaluation']}")
    for item in evaluation["tables"]:
        print(f"\n{item['title']}")
        for row in item["rows"]:
            print(f"  {row['label']}")
            for column, cell in zip(item["columns"], row["cells"], strict=True):
                print(f"    {column['label']:28} {cell['value']}  ({cell['count']}/{cell['of']})")
