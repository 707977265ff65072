"""From a frame to codes as the authors' published facts describe it: slow, plain, their names.

Their axes, Euler angles and normalised boxes; float64 but for the pooling, whose roundings are of
float32; the batch normalisations and poolings where theirs are, nothing folded.
"""

import math

import numpy as np
import torch
from torch.nn import functional


def random_tensors(entries, seed=0):
    """Values of the sizes that trained networks have, so that every layer matters."""
    generator = torch.Generator().manual_seed(seed)
    tensors = {}
    for name, shape in entries.items():
        noise = torch.randn(shape, generator=generator)
        if name.endswith("num_batches_tracked"):
            tensors[name] = torch.zeros(shape, dtype=torch.int64)
        elif name.endswith("running_var"):
            tensors[name] = 0.6 + noise.abs()
        elif len(shape) > 1:
            tensors[name] = noise * (1.5 / noise[0].numel()) ** 0.5
        elif name.endswith("weight"):
            tensors[name] = 1 + 0.2 * noise
        else:
            tensors[name] = 0.3 * noise
    return tensors


STATISTICS = ("weight", "bias", "running_mean", "running_var")


def normalise(tensors, name, maps):
    """Batch normalisation at evaluation."""
    by = {key: tensors[f"{name}.{key}"].double()[:, None, None] for key in STATISTICS}
    centred = (maps - by["running_mean"]) / torch.sqrt(by["running_var"] + 1e-5)
    return centred * by["weight"] + by["bias"]


def convolve(tensors, name, maps, stride=1):
    kernel = tensors[f"{name}.weight"].double()
    return functional.conv2d(maps, kernel, stride=stride, padding=kernel.shape[-1] // 2)


def leaky(maps):
    return torch.where(maps > 0, maps, 0.2 * maps)


def pool(maps, size):
    """Mean of each size x size square."""
    rows, columns = maps.shape[-2] // size, maps.shape[-1] // size
    squares = maps[..., : rows * size, : columns * size]
    return squares.unflatten(-1, (columns, size)).unflatten(-3, (rows, size)).mean(dim=(-3, -1))


def block(tensors, name, maps, size, last=True):
    inner = normalise(tensors, f"{name}.bn1", pool(convolve(tensors, f"{name}.conv1", maps), size))
    inner = convolve(tensors, f"{name}.conv2", leaky(inner))
    inner = normalise(tensors, f"{name}.bn2", inner)
    if f"{name}.downsample.0.weight" in tensors:
        maps = pool(convolve(tensors, f"{name}.downsample.0", maps), size)
        maps = normalise(tensors, f"{name}.downsample.2", maps)
    return leaky(inner + maps) if last else inner + maps


def residual_features(tensors, pictures):
    maps = leaky(normalise(tensors, "bn1", convolve(tensors, "conv1", pictures, stride=2)))
    maps = block(tensors, "initial_backbone.0", maps, 2)
    maps = block(tensors, "initial_backbone.1", maps, 1)
    for index in range(6):
        maps = block(tensors, f"final_backbone.{index}", maps, 2 if index % 2 == 0 else 1)
    return maps.mean(dim=(-2, -1))


def attentive_features(tensors, pictures, view):
    maps = view[:, :, None, None] * torch.ones(1, 1, *pictures.shape[-2:]).double()
    maps = convolve(tensors, "conv1", torch.cat([pictures, maps], dim=1))
    maps = leaky(normalise(tensors, "bn1", pool(maps, 2)))
    maps = block(tensors, "initial_backbone.0", maps, 1, last=False)
    maps = leaky(maps[:, :16]) / (1 + torch.exp(-maps[:, 16:]))
    for index in range(4):
        maps = block(tensors, f"final_backbone.{index}", maps, 2 if index % 2 == 0 else 1)
    return maps.mean(dim=(-2, -1))


def head(tensors, name, features):
    return features @ tensors[f"{name}.weight"].double().T + tensors[f"{name}.bias"].double()


def yaw(tensors, pictures):
    """Offset from the camera's y angle."""
    features = residual_features(tensors, pictures)
    across, along = (1.4 * torch.tanh(head(tensors, "rotation_head", features))).unbind(dim=1)
    return torch.atan2(along, across)


def elementary(axis, angle):
    """A right-handed rotation about one axis."""
    c, s = math.cos(angle), math.sin(angle)
    rows = {
        "x": [[1, 0, 0], [0, c, -s], [0, s, c]],
        "y": [[c, 0, s], [0, 1, 0], [-s, 0, c]],
        "z": [[c, -s, 0], [s, c, 0], [0, 0, 1]],
    }
    return np.array(rows[axis])


def camera_matrix(angles):
    """Camera to world: about z first, then x, then y."""
    a, b, c = (float(each) for each in angles)
    return elementary("y", b) @ elementary("x", a) @ elementary("z", c)


def foot(box, camera, size, up):
    """Where the middle of the box's lower edge meets the ground; `up` is the index of the axis."""
    angles, place, focal = camera
    u = ((box[0] + box[2]) / 2 - 0.5) * size[0]
    v = (box[3] - 0.5) * size[1]
    direction = camera_matrix(angles) @ np.array([u, -v, -focal])
    point = place - place[up] / (direction[up] + 1e-6) * direction
    point[up] = 0
    return point


def expanded(box, aside, above):
    left, top, right, bottom = box
    width, height = right - left, bottom - top
    wide = (left - aside * width, top - above * height, right + aside * width, bottom)
    return tuple(min(max(each, 0.0), 1.0) for each in wide)


def projected(low, high, place, camera, size):
    """Normalised box of an object's corners and five points within each edge."""
    angles, eye, focal = camera
    corners = [
        np.array([x, y, z])
        for x in _ends(low, high, 0)
        for y in _ends(low, high, 1)
        for z in _ends(low, high, 2)
    ]
    points = list(corners)
    for i, first in enumerate(corners):
        for second in corners[i + 1 :]:
            if (first != second).sum() == 1:
                points += [first + (second - first) * n / 6 for n in range(1, 6)]
    u, v = [], []
    for point in points:
        x, y, z = camera_matrix(angles).T @ (point + place - eye)
        if z <= 0:
            u.append((-x / z * focal + size[0] / 2) / size[0])
            v.append((y / z * focal + size[1] / 2) / size[1])
    box = min(u), min(v), max(u), max(v)
    return tuple(min(max(each, 0.0), 1.0) for each in box)


def _ends(low, high, axis):
    return float(low[axis]), float(high[axis])


def pooled(picture, box, height, width):
    """Maximum over the cells of a grid on a normalised box of a picture in [-1, 1]."""
    rows, columns = picture.shape[1:]
    left, top, right, bottom = np.array(box, np.float32) * np.array([columns, rows] * 2, np.float32)
    crop = np.zeros((len(picture), height, width))
    across = list(cells(left, right, width, columns))
    for i, (y0, y1) in enumerate(cells(top, bottom, height, rows)):
        for j, (x0, x1) in enumerate(across):
            if y1 > y0 and x1 > x0:
                crop[:, i, j] = picture[:, y0:y1, x0:x1].max(axis=(1, 2))
    return torch.from_numpy(crop)


def cells(low, high, count, extent):
    """First pixel and the one after the last of each cell along one axis."""
    first = rounded(low)
    size = np.float32(max(rounded(high) - first + 1, 1)) / np.float32(count)
    for cell in range(count):
        start = math.floor(np.float32(cell) * size) + first
        stop = math.ceil(np.float32(cell + 1) * size) + first
        yield min(max(start, 0), extent), min(max(stop, 0), extent)


def rounded(edge):
    """Halves away from zero."""
    return int(math.copysign(math.floor(abs(float(edge)) + 0.5), float(edge)))
