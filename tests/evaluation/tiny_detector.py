"""A tiny ONNX model in Ultralytics' layout: a matched filter for small bright discs.

It is no detector worth the name. It has the input, the output and the metadata of one, so the loop
around a detector can be tested: export, run, predictions, acceptance.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import onnx
from onnx import TensorProto, helper, numpy_helper

SIDES = (3, 5, 7)
"""Diameters of the filters, pixels of the input."""
SECTORS = 8
"""Parts of the ring around a disc; all of them must be darker."""
STEEPNESS, MIDDLE = 14.0, 0.25
"""Of the sigmoid that turns contrast into a score."""


def write_tiny_detector(
    path: Path, width: int, height: int, classes: tuple[str, ...] = ("ball",)
) -> Path:
    """Write the model for an input of that size; all classes but the last never fire.

    Input ``images`` (1, 3, H, W), RGB in [0, 1]; output ``output0`` (1, 4 + classes, N).
    """
    # The smallest colour: white is bright in all three, grass and most shirts are not.
    nodes = [helper.make_node("ReduceMin", ["images"], ["white"], axes=[1], keepdims=1)]
    weights, outputs = [], []
    for index, side in enumerate(SIDES):
        found = _branch(index, side, width, height, len(classes))
        nodes += found[0]
        weights += found[1]
        outputs.append(f"boxes{index}")
    nodes.append(helper.make_node("Concat", outputs, ["output0"], axis=2))
    graph = helper.make_graph(
        nodes,
        "tiny",
        [helper.make_tensor_value_info("images", TensorProto.FLOAT, [1, 3, height, width])],
        [helper.make_tensor_value_info("output0", TensorProto.FLOAT, [1, 4 + len(classes), None])],
        weights,
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=8)
    names = dict(enumerate(classes))
    helper.set_model_props(model, {"names": repr(names), "task": "detect", "stride": "1"})
    onnx.checker.check_model(model)
    path.write_bytes(model.SerializeToString())
    return path


def _branch(
    index: int, side: int, width: int, height: int, classes: int
) -> tuple[list[onnx.NodeProto], list[onnx.TensorProto]]:
    """One size of ball: contrast of disc and surround, peaks alone, as boxes."""
    cells = width * height
    # YOLO counts from the corner of the first pixel.
    across, down = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)
    places = np.stack([across.ravel(), down.ravel(), np.full(cells, side), np.full(cells, side)])
    silent_classes = np.zeros((1, classes - 1, cells), np.float32)
    constants = {
        f"filter{index}": _filter(side),
        f"shift{index}": np.float32(STEEPNESS * MIDDLE).reshape(1),
        f"steep{index}": np.float32(STEEPNESS).reshape(1),
        f"places{index}": places[None].astype(np.float32),
        f"silent_classes{index}": silent_classes,
        f"flat{index}": np.array([1, 1, cells], np.int64),
    }

    def node(kind: str, inputs: list[str], output: str, **options: object) -> onnx.NodeProto:
        return helper.make_node(
            kind, [f"{name}{index}" if name != "white" else name for name in inputs],
            [f"{output}{index}"], **options,
        )  # fmt: skip

    pad = [side, side, side, side]
    nodes = [
        node("Conv", ["white", "filter"], "sectors", pads=pad),
        node("ReduceMin", ["sectors"], "contrast", axes=[1], keepdims=1),
        node("MaxPool", ["contrast"], "peak", kernel_shape=[7, 7], pads=[3, 3, 3, 3]),
        node("Equal", ["contrast", "peak"], "isPeak"),
        node("Cast", ["isPeak"], "kept", to=TensorProto.FLOAT),
        node("Mul", ["contrast", "steep"], "scaled"),
        node("Sub", ["scaled", "shift"], "moved"),
        node("Sigmoid", ["moved"], "sure"),
        node("Mul", ["sure", "kept"], "score"),
        node("Reshape", ["score", "flat"], "scores"),
        node("Concat", ["places", "silent_classes", "scores"], "boxes", axis=1),
    ]
    return nodes, [numpy_helper.from_array(array, name) for name, array in constants.items()]


def _filter(side: int) -> np.ndarray:
    """Mean over a disc less mean over one sector of the ring around it, for each sector."""
    y, x = np.mgrid[-side : side + 1, -side : side + 1]
    radius = np.hypot(x, y)
    disc = radius <= side / 2
    ring = (radius > side / 2 + 1) & (radius <= side)
    sector = ((np.arctan2(y, x) / np.pi + 1) / 2 * SECTORS).astype(int) % SECTORS
    parts = [ring & (sector == index) for index in range(SECTORS)]
    weights = [disc / disc.sum() - part / max(part.sum(), 1) for part in parts]
    return np.array(weights, np.float32)[:, None]
