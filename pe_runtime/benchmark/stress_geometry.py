"""Stress of cameras, rays, boxes, feet and angles."""

import math

import torch
from torch import Tensor

from pe_runtime.benchmark.stress_cases import (
    Case,
    Measured,
    Outcome,
    Spread,
    Trial,
    compare,
    finite,
    gradients,
    one_of,
    worst,
)
from pe_runtime.benchmark.stress_reference import exact_passage
from pe_runtime.geometry.boxes import intersect_box
from pe_runtime.geometry.native_world import LOCK, euler_from_rotation, rotation_from_euler
from pe_runtime.rendering.release_2022 import OFFSET

RAYS = 6
WAYS = (
    "anywhere",
    "in a face",
    "along an edge",
    "through a corner",
    "parallel inside",
    "parallel outside",
    "nearly parallel",
)
BOXES = ("proper", "thin", "flat", "inverted")
HERE = 1e-3
"""Cameras nearer to a box's middle than this many box sizes are at it."""


def meet_boxes(trial: Trial) -> Outcome:
    """Rays of every kind against boxes of every kind; both quadratures when in float32."""
    low, high = _box(trial)
    origins, directions = _rays(trial, low, high)
    near = 0.05 * trial["scale"]
    found = [_met(trial, (origins, directions), (low, high), near, None)]
    if trial.precision == "float32":
        offset = torch.full((3,), OFFSET)
        found.append(_met(trial, (origins, directions), (low, high), near, offset))
    return Outcome(
        worst([each.forward for each in found]), worst([each.backward for each in found])
    )


def _met(
    trial: Trial,
    rays: tuple[Tensor, Tensor],
    box: tuple[Tensor, Tensor],
    near: float,
    offset: Tensor | None,
) -> Outcome:
    origins, directions = (each.clone().requires_grad_() for each in rays)
    entry, leave, hit = intersect_box(origins, directions, *box, near, offset)
    errors, bad = [0.0], int((~torch.isfinite(entry) | ~torch.isfinite(leave)).sum())
    moved = rays[1] if offset is None else rays[1] + offset
    for ray in range(RAYS):
        exact = exact_passage(rays[0][ray], moved[ray], *box, near)
        passed = (entry[ray].item(), leave[ray].item()) if hit[ray] else None
        errors.append(_disagreement(passed, exact))
    slopes = gradients(entry.sum() + leave.sum(), (origins, directions))
    return Outcome(Measured(max(errors), 4 * trial.epsilon, bad), finite(*slopes))


def _disagreement(found: tuple[float, float] | None, exact: tuple[float, float] | None) -> float:
    """By which share of the exit's depth two passages differ; a missed one counts whole."""
    if found is None and exact is None:
        return 0.0
    if found is None or exact is None:
        entry, leave = found or exact
        return (leave - entry) / leave
    return max(abs(a - b) for a, b in zip(found, exact, strict=True)) / exact[1]


def _box(trial: Trial) -> tuple[Tensor, Tensor]:
    low = torch.tensor([-1.0, -0.5, 0.25], dtype=torch.float64)
    high = torch.tensor([1.0, 0.75, 2.0], dtype=torch.float64)
    kind = BOXES[trial.count("box")]
    if kind == "thin":
        high[1] = low[1] + 1e-6
    elif kind == "flat":
        high[1] = low[1]
    elif kind == "inverted":
        low[1], high[1] = high[1].clone(), low[1].clone()
    low, high = ((each * trial["scale"]).to(trial.dtype) for each in (low, high))
    return low, high


def _rays(trial: Trial, low: Tensor, high: Tensor) -> tuple[Tensor, Tensor]:
    """Rays that start near and far from a box, or in it, and aim as the trial says."""
    generator, way = trial.generator(), WAYS[trial.count("way")]
    corner = torch.where(torch.rand(RAYS, 3, generator=generator) < 0.5, low, high)
    inside = torch.rand(RAYS, 3, generator=generator).to(trial.dtype) * (high - low) + low
    away = torch.randn(RAYS, 3, generator=generator).to(trial.dtype)
    size = (high - low).abs().max()
    origins = (low + high) / 2 + away * (size * (trial["distance"] > HERE) * trial["distance"])
    aim = {"anywhere": inside, "through a corner": corner}.get(way, inside)
    directions = aim - origins
    axis = torch.arange(RAYS) % 3
    rows, others = torch.arange(RAYS), (axis + 1) % 3
    if way in ("in a face", "along an edge"):
        origins[rows, axis], directions[rows, axis] = corner[rows, axis], 0.0
    if way == "along an edge":
        origins[rows, others], directions[rows, others] = corner[rows, others], 0.0
    if way in ("parallel inside", "parallel outside", "nearly parallel"):
        origins[rows, axis] = inside[rows, axis]
        directions[rows, axis] = size * 10.0 ** -trial["slant"] if way == "nearly parallel" else 0.0
    if way == "parallel outside":
        origins[rows, axis] = high[axis] + size
    still = (directions == 0).all(dim=1)
    directions[still] = torch.ones(3, dtype=trial.dtype) * size
    return origins, directions


def turn_and_read_angles(trial: Trial) -> Outcome:
    """Euler angles of a rotation, up to the lock where two of them turn about the same axis."""
    generator = trial.generator()
    angles = torch.rand(RAYS, 3, generator=generator, dtype=torch.float64) * math.tau - math.pi
    angles[:, 0] = torch.sign(angles[:, 0]) * (math.pi / 2 - trial["from_lock"])
    rotation = rotation_from_euler(angles)
    again = rotation_from_euler(euler_from_rotation(rotation))
    # Of a cosine c only c +- eps is known, so its angles are to within eps / c.
    unit = 1.0 / max(math.sin(trial["from_lock"]), LOCK)
    return Outcome(compare(again, rotation, unit, 8 * trial.epsilon))


_GAPS = Spread((0.0, 1e-15, 1e-12, 1e-9, 1e-6, 1e-3, 1.5))

GEOMETRY = (
    Case(
        "rays and boxes",
        {
            "way": one_of(WAYS),
            "box": one_of(BOXES),
            "scale": Spread((1e-3, 1.0, 1e6)),
            "distance": Spread((0.0, 1.0, 1e5)),
            "slant": Spread((2.0, 8.0, 17.0, 40.0, 200.0)),
        },
        meet_boxes,
        "4 eps of the exit's depth, of a missed passage its whole length; against rational numbers",
        ("float64", "float32", "bfloat16"),
        draws=24,
        examples=30,
    ),
    Case(
        "angles near the lock",
        {"from_lock": _GAPS},
        turn_and_read_angles,
        "8 eps / cos of the angle to the lock, of which arc tangents see two small numbers",
        ("float64",),
    ),
)
