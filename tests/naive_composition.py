"""The slow twin of `rendering.renderer.compose`: one ray, sample by sample, in float64.

Written from the equations with Python loops and nothing shared with the fast code but the weights,
which the caller casts to double.
"""

import math
from dataclasses import dataclass

import torch

SKY_DEPTH, OPAQUE, SHIFT = 1e9, 1e4, 2.5


@dataclass
class Sample:
    owner: int
    depth: float
    thickness: float
    coordinates: torch.Tensor
    weight: float = 0.0


@dataclass
class Seen:
    features: torch.Tensor
    shares: list
    depth: float
    solid: float


def look_along(centre, direction, frame, objects, near):
    """What one ray sees: all feature channels, every object's share, depth and solid weight."""
    samples = []
    for owner, each in enumerate(objects):
        if bool(each.visible[frame]):
            samples += samples_of(owner, each, centre, direction, frame, near)
    samples.sort(key=lambda sample: sample.depth)
    transmittance = 1.0
    for sample in samples:
        sample.weight = transmittance * (1 - math.exp(-sample.thickness))
        transmittance *= math.exp(-sample.thickness)
    channels = objects[0].field.output.out_features if objects else 0
    seen = Seen(torch.zeros(channels, dtype=torch.float64), [0.0] * len(objects), 0.0, 0.0)
    for sample in samples:
        each = objects[sample.owner]
        seen.features += sample.weight * feature(each, sample.coordinates, frame)
        seen.shares[sample.owner] += sample.weight
        if each.field.config.kind != "sky":
            seen.depth += sample.weight * sample.depth
            seen.solid += sample.weight
    return seen


def samples_of(owner, each, centre, direction, frame, near):
    config = each.field.config
    if config.kind == "sky":
        unit = direction / math.sqrt(sum(float(d) ** 2 for d in direction))
        return [Sample(owner, SKY_DEPTH, OPAQUE, unit)]
    origin = centre - each.position[frame].double()
    passage = enter_and_leave(origin.tolist(), direction.tolist(), config.low, config.high, near)
    if passage is None:
        return []
    entry, leave = passage
    count, place = (1, 0.0) if config.opaque else (config.samples, 0.5)
    step = (leave - entry) / count
    length = step * math.sqrt(sum(float(d) ** 2 for d in direction))
    samples = []
    for number in range(count):
        depth = entry + (number + place) * step
        at = in_half_boxes(origin + depth * direction, config.low, config.high)
        thickness = OPAQUE if config.opaque else length * density(each, at, frame)
        samples.append(Sample(owner, depth, thickness, at))
    return samples


def enter_and_leave(origin, direction, low, high, near):
    entry, leave = near, math.inf
    for o, d, a, b in zip(origin, direction, low, high, strict=True):
        if d == 0:
            if not a < o < b:
                return None
            continue
        entry = max(entry, min((a - o) / d, (b - o) / d))
        leave = min(leave, max((a - o) / d, (b - o) / d))
    return (entry, leave) if leave > entry and math.isfinite(leave) else None


def in_half_boxes(point, low, high):
    middle = [(a + b) / 2 for a, b in zip(low, high, strict=True)]
    extent = [(b - a) / 2 for a, b in zip(low, high, strict=True)]
    values = [(float(p) - m) / e for p, m, e in zip(point, middle, extent, strict=True)]
    return torch.tensor([min(max(v, -1.0), 1.0) for v in values], dtype=torch.float64)


def encode(point, frequencies):
    angles = [float(f) * float(p) for f in frequencies for p in point]
    values = [*map(float, point), *map(math.sin, angles), *map(math.cos, angles)]
    return torch.tensor(values, dtype=torch.float64)


def relu(vector):
    return vector.clamp(min=0.0)


def apply(layer, vector):
    result = layer.weight.detach() @ vector
    return result if layer.bias is None else result + layer.bias.detach()


def bend(bending, point, pose):
    hidden = apply(bending.layers[0], encode(point, bending.encoding.frequencies))
    hidden = hidden + apply(bending.pose, pose)
    for layer in list(bending.layers)[1:]:
        hidden = apply(layer, relu(hidden))
    return (point + apply(bending.output, relu(hidden))).clamp(-1.0, 1.0)


def trunk(each, point, frame):
    field = each.field
    if field.bending is not None:
        point = bend(field.bending, point, each.pose[frame].double())
    encoded = encode([point[a] for a in field.config.axes], field.encoding.frequencies)
    hidden = relu(apply(field.layers[0], encoded))
    for index in range(1, len(field.layers)):
        hidden = apply(field.layers[index], hidden)
        if index == field.config.field.skip:
            hidden = hidden + apply(field.skip, encoded)
        hidden = relu(hidden)
    return hidden


def density(each, point, frame):
    raw = float(apply(each.field.density, trunk(each, point, frame))[0])
    return math.log1p(math.exp(raw - SHIFT)) * each.field.config.field.density_scale


def feature(each, point, frame):
    hidden, style = trunk(each, point, frame), each.style[frame].double()
    for layer, modulation in zip(each.field.head, each.field.modulations, strict=True):
        scale, shift = apply(modulation.scale, style), apply(modulation.shift, style)
        hidden = relu(scale * apply(layer, hidden) + shift)
    return apply(each.field.output, hidden)
