"""Train on a version: python train_loop.py SOURCE [FRAMES]

A patch around the ball, or around some other place: a linear model learns which it is. With PyTorch,
give the same samples to torch.utils.data.DataLoader; nothing else changes.
"""

import sys

import numpy as np

import touchline

SIDE, EPOCHS, BATCH = 16, 5, 8
random = np.random.default_rng(0)


def patches(sample):
    """Two patches of a sample, in [0, 1], shape (2, SIDE, SIDE, 3): with the ball, and without."""
    width, height = sample["size"]
    elsewhere = random.uniform((SIDE, SIDE), (width - SIDE, height - SIDE))
    found = []
    for x, y in (sample["center"], elsewhere):
        left = int(np.clip(round(x) - SIDE // 2, 0, width - SIDE))
        top = int(np.clip(round(y) - SIDE // 2, 0, height - SIDE))
        found.append(sample["image"][top : top + SIDE, left : left + SIDE] / 255)
    return np.stack(found)


def batches(samples):
    """Patches and labels of a few samples at a time, in another order in each epoch."""
    order = random.permutation(len(samples))
    for start in range(0, len(order), BATCH):
        taken = [samples[int(index)] for index in order[start : start + BATCH]]
        yield np.concatenate(taken).reshape(2 * len(taken), -1), np.tile([1.0, 0.0], len(taken))


version = touchline.open(sys.argv[1], frames=sys.argv[2] if len(sys.argv) > 2 else None)
split = "train" if "train" in version.splits else None
samples = version.samples(
    split, where=lambda view: view.in_valid_pair and view.ball is not None, transform=patches
)
print(f"{version}: {len(samples)} samples to train on")
weights, bias = np.zeros(SIDE * SIDE * 3), 0.0
for epoch in range(EPOCHS):
    losses = []
    for x, y in batches(samples):
        predicted = 1 / (1 + np.exp(-(x @ weights + bias)))
        losses.append(-np.log(np.where(y == 1, predicted, 1 - predicted) + 1e-12).mean())
        weights -= 0.01 * x.T @ (predicted - y) / len(y)
        bias -= 0.01 * (predicted - y).mean()
    print(f"epoch {epoch + 1}: loss {np.mean(losses):.3f}")
