"""One ray through the authors' scene, as their published facts describe it: slow and plain.

Python loops over objects, samples and layers, float64, their axes, their names, nothing folded.
"""

import math
from dataclasses import dataclass

import numpy as np

EMPTY = -3.5


@dataclass(frozen=True)
class TwinObject:
    """One object in their terms; `tensors` are its entries, as in a checkpoint."""

    tensors: dict
    low: tuple
    high: tuple
    samples: int
    depth_range: tuple
    style: np.ndarray
    deformation: np.ndarray
    depth: int
    skip: int
    octaves: int
    bending: tuple | None = None  # depth, skip, octaves
    translation: tuple = (0.0, 0.0, 0.0)
    rotation: tuple = (0.0, 0.0, 0.0)
    sky: bool = False
    playable: bool = False


def encode(point, octaves, weights=None):
    parts = [np.asarray(point)]
    for k in range(octaves):
        weight = 1.0 if weights is None else weights[k]
        parts += [weight * np.sin(2.0**k * parts[0]), weight * np.cos(2.0**k * parts[0])]
    return np.concatenate(parts)


def linear(tensors, name, x):
    y = tensors[f"{name}.weight"] @ x
    return y + tensors[f"{name}.bias"] if f"{name}.bias" in tensors else y


def trunk(each, encoded):
    hidden = encoded
    for layer in range(each.depth):
        if layer and layer == each.skip:
            hidden = np.concatenate([hidden, encoded])
        hidden = np.maximum(linear(each.tensors, f"nerf_model.backbone_layers.{layer}", hidden), 0)
    return hidden


def modulated(each, hidden, number):
    name = f"nerf_model.features_head.{number}"
    mean = each.tensors[f"{name}.ada_in.normalization.running_mean"]
    var = each.tensors[f"{name}.ada_in.normalization.running_var"]
    affine = linear(each.tensors, f"{name}.affine_transform", each.style)
    scale, bias = affine[: len(hidden)], affine[len(hidden) :]
    return (hidden - mean) / np.sqrt(var + 1e-5) * scale + bias


def features(each, hidden):
    for number in (0, 3):
        hidden = linear(each.tensors, f"nerf_model.features_head.{number}", hidden)
        hidden = np.maximum(modulated(each, hidden, number + 1), 0)
    return linear(each.tensors, "nerf_model.features_head.6", hidden)


def bent(each, point):
    if each.bending is None:
        return point
    depth, skip, octaves = each.bending
    low, high = np.array(each.low), np.array(each.high)
    progress = float(each.tensors["ray_bender.positional_encoder.current_step"]) * octaves / 60000
    opened = [(1 - math.cos(math.pi * min(max(progress - k, 0), 1))) / 2 for k in range(octaves)]
    entering = np.concatenate([encode(point / (high - low), octaves, opened), each.deformation])
    hidden = entering
    for layer in range(depth):
        if layer and layer == skip:
            hidden = np.concatenate([hidden, entering])
        hidden = np.maximum(linear(each.tensors, f"ray_bender.backbone_layers.{layer}", hidden), 0)
    displacement = linear(each.tensors, "ray_bender.output_head", hidden) * (high - low)
    return np.clip(point + displacement, low, high)


def inside(each, point):
    return all(a <= x <= b for a, x, b in zip(each.low, point, each.high, strict=True))


def rotation_matrix(angles):
    (a, b, c) = angles
    x = np.array([[1, 0, 0], [0, math.cos(a), -math.sin(a)], [0, math.sin(a), math.cos(a)]])
    y = np.array([[math.cos(b), 0, math.sin(b)], [0, 1, 0], [-math.sin(b), 0, math.cos(b)]])
    z = np.array([[math.cos(c), -math.sin(c), 0], [math.sin(c), math.cos(c), 0], [0, 0, 1]])
    return y @ x @ z


def samples_on_ray(each, origin, direction):
    """(t, raw density, features) of each sample of one object."""
    turn = rotation_matrix(each.rotation).T
    origin, direction = turn @ (origin - np.array(each.translation)), turn @ direction
    first = [(f - o) / (d + 1e-6) for f, o, d in zip(each.low, origin, direction, strict=True)]
    second = [(f - o) / (d + 1e-6) for f, o, d in zip(each.high, origin, direction, strict=True)]
    near = max(min(a, b) for a, b in zip(first, second, strict=True))
    far = min(max(a, b) for a, b in zip(first, second, strict=True))
    if far <= near:
        near = far = 0.0
    near, far = (min(max(t, each.depth_range[0]), each.depth_range[1]) for t in (near, far))
    count, size = each.samples, np.array(each.high) - np.array(each.low)
    found = []
    for k in range(count):
        t = near if count == 1 else near + (far - near) * k / (count - 1)
        point, raw, seen = origin + t * direction, EMPTY, 0.0
        if each.sky:
            unit = direction / np.linalg.norm(direction)
            entering = encode(np.concatenate([origin / size, unit]), each.octaves)
            raw, seen = 10.0, features(each, trunk(each, entering))
        elif inside(each, point):
            hidden = trunk(each, encode(bent(each, point) / size, each.octaves))
            raw = linear(each.tensors, "nerf_model.alpha_head", hidden)[0]
            seen = features(each, hidden)
        found.append((t, raw, seen))
    return found


def carve_overlaps(objects, found):
    carved = [list(each) for each in found]
    for s, static in enumerate(objects):
        for p, player in enumerate(objects):
            if static.playable or not player.playable:
                continue
            first = found[p][0][0]
            second = found[p][static.samples - 1][0]
            for k, (t, _, seen) in enumerate(found[s]):
                if first <= t < second:
                    carved[s][k] = (0.0, -10.0, seen)
    return carved


def along_ray(objects, origin, direction, channels, carve=False):
    """Integrated features, depth and opacity of one ray."""
    found = [samples_on_ray(each, origin, direction) for each in objects]
    if carve:
        found = carve_overlaps(objects, found)
    line = sorted((sample for each in found for sample in each), key=lambda sample: sample[0])
    length, light = np.linalg.norm(direction), 1.0
    total, depth, opacity = np.zeros(channels), 0.0, 0.0
    for k, (t, raw, seen) in enumerate(line):
        gap = line[k + 1][0] - t if k + 1 < len(line) else 1e10
        alpha = 1 - math.exp(-max(raw, 0.0) * gap * length)
        weight = alpha * light
        light *= 1 - alpha + 1e-10
        total, depth, opacity = total + weight * seen, depth + weight * t, opacity + weight
    return total, depth, opacity
