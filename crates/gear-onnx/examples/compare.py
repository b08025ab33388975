"""Compares what the example `answer` wrote with the Python runtime: python compare.py MODEL.onnx OUT.

Prepares the picture by its own code from the declaration beside the model (sizes `any` and `fixed` of the picture's own
size and no `half_size`, so that no resampling enters), runs `onnxruntime`, and prints the largest difference and the least
of six times.
Needs onnxruntime, numpy and PyYAML.
"""

import pathlib
import sys
import time

import numpy as np
import onnxruntime
import yaml

model, out = pathlib.Path(sys.argv[1]), pathlib.Path(sys.argv[2])
declared = yaml.safe_load(model.with_suffix(".yaml").read_text())
picture = np.clip(np.load(out / "picture.npy"), 0, 1)
size = declared.get("size", "any")
multiple = size["any"].get("multiple", 1) if isinstance(size, dict) and "any" in size else 1
if isinstance(size, dict) and "fixed" in size:
    fixed = size["fixed"]
    assert picture.shape[:2] == (fixed["height"], fixed["width"]), "give a picture of the network's own size"

kind = declared["answer"] if isinstance(declared["answer"], str) else next(iter(declared["answer"]))
options = {} if isinstance(declared["answer"], str) else declared["answer"][kind]
assert not options.get("half_size"), "declare it without half_size: resampling is gear's own"

scale = picture.max() if declared.get("divide_by_maximum") else 1.0
names = {"red": 0, "green": 1, "blue": 2}
channels = declared.get("channels", ["red", "green", "blue"])
height, width = picture.shape[:2]
padded = [-(-side // multiple) * multiple for side in (height, width)]
planes = []
for i, name in enumerate(channels):
    if name in names:
        plane = picture[..., names[name]] / scale * declared.get("white", 1)
    else:
        plane = np.load(out / f"{name}.npy")
    mean, std = declared.get("mean") or [0], declared.get("std") or [1]
    plane = (plane - mean[i if len(mean) > 1 else 0]) / std[i if len(std) > 1 else 0]
    planes.append(np.pad(plane, ((0, padded[0] - height), (0, padded[1] - width)), mode="edge"))
tensor = np.stack(planes)[None].astype(np.float32)

session = onnxruntime.InferenceSession(str(model), providers=["CPUExecutionProvider"])
name, least = session.get_inputs()[0].name, float("inf")
for _ in range(6):
    start = time.perf_counter()
    answer = session.run(None, {name: tensor})[0]
    least = min(least, time.perf_counter() - start)
answer = answer.reshape(-1, *answer.shape[-2:])[:, :height, :width]
if options.get("activation") == "min-max":
    answer = (answer - answer.min()) / (answer.max() - answer.min())
if kind == "surface":
    normal = answer[:3].copy()
    normal[2] = np.maximum(normal[2], 1e-3)
    answer = np.concatenate([normal / np.linalg.norm(normal, axis=0), answer[3:] * options.get("height", 1)])
for i, plane in enumerate(answer):
    ours = np.load(out / f"answer{i}.npy")
    print(f"channel {i}: largest difference {np.abs(ours - plane).max():.2e}, largest sample {np.abs(plane).max():.3g}")
print(f"Python: {least:.3f} s, onnxruntime {onnxruntime.__version__}")
