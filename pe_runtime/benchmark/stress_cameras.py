"""Stress of cameras: pixels to rays, points to pixels, feet to the ground, volumes to boxes.

All of it is float64 whatever networks run in. "bfloat16" stands for being called where they run in
it, which must change nothing; "float32" for rays as the "release-2022" quadrature wants them.
"""

import math
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from pe_runtime.benchmark.stress_cases import (
    Case,
    Measured,
    Outcome,
    Spread,
    Trial,
    compare,
    one_of,
    worst,
)
from pe_runtime.benchmark.stress_reference import as_array, as_tensor
from pe_runtime.geometry.boxes import box_in_image, corners, outline, visible_box_in_image
from pe_runtime.geometry.cameras import HORIZON, Cameras, project, ray_directions
from pe_runtime.perception.localization import locate

WIDTH, HEIGHT, COUNT = 512, 288, 12
EPSILON, SINGLE = torch.finfo(torch.float64).eps, torch.finfo(torch.float32).eps
MIDDLE = (WIDTH / 2 + 0.3, HEIGHT / 2 - 0.2)
BOXES = ("proper", "flat", "inverted", "absent")


def camera_at(
    place: np.ndarray, focal: float, yaw: float, tilt: float
) -> tuple[Cameras, np.ndarray]:
    """One camera and its rotation as extended-precision numbers.

    Args:
        place: Metres.
        focal: Pixels.
        yaw: Radians to the left of +y.
        tilt: Radians below the horizontal.
    """
    cy, sy, ct, st = math.cos(yaw), math.sin(yaw), math.cos(tilt), math.sin(tilt)
    rotation = np.array([[cy, -sy * st, -sy * ct], [sy, cy * st, cy * ct], [0.0, -ct, -st]])
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = rotation, place
    intrinsics = np.array([[focal, 0, MIDDLE[0]], [0, focal * 1.05, MIDDLE[1]], [0, 0, 1.0]])
    cameras = Cameras(
        WIDTH, HEIGHT, torch.from_numpy(intrinsics)[None], torch.from_numpy(pose)[None]
    )
    return cameras, rotation.astype(np.longdouble)


def shoot_rays(trial: Trial) -> Outcome:
    """Directions of rays through pixels, also far outside the picture."""
    generator = np.random.default_rng(trial.seed)
    cameras, rotation = camera_at(np.zeros(3), trial["focal"], *generator.uniform(-3, 3, 2))
    pixels = generator.uniform(-1, 2, (COUNT, 2)) * (WIDTH, HEIGHT)
    kind = torch.float64 if trial.precision == "float64" else torch.float32
    with trial.mixed():
        frame = torch.zeros(COUNT, dtype=torch.long)
        found = ray_directions(cameras, frame, torch.from_numpy(pixels), kind)
    focals = np.array([trial["focal"], trial["focal"] * 1.05], dtype=np.longdouble)
    local = np.concatenate([(pixels - MIDDLE) / focals, np.ones((COUNT, 1))], axis=1)
    exact = (rotation @ local.T).T
    # The subtraction of the middle rounds its pixels, however near they are.
    unit = 1 + (np.abs(pixels).max(axis=1) + max(MIDDLE)) / trial["focal"]
    bound = 8 * torch.finfo(kind).eps
    forward = compare(found, as_tensor(exact), as_tensor(unit)[:, None], bound)
    return Outcome(forward)


def project_points(trial: Trial) -> Outcome:
    """Pixels and depths of points around a camera far from the origin."""
    generator = np.random.default_rng(trial.seed)
    scale = trial["scale"]
    place = generator.normal(size=3) * scale * trial["away"]
    cameras, rotation = camera_at(place, trial["focal"], *generator.uniform(-1, 1, 2))
    points = place + generator.normal(size=(COUNT, 3)) * scale * 5
    with trial.mixed():
        pixels, depth = project(cameras, torch.from_numpy(points)[None])
    local = (points.astype(np.longdouble) - place) @ rotation
    reach = np.abs(points).max(axis=1) + np.abs(place).max()
    behind = local[:, 2] <= reach * 1e-9
    safe = np.where(behind, 1.0, local[:, 2])
    focals = np.array([trial["focal"], trial["focal"] * 1.05])
    exact = local[:, :2] / safe[:, None] * focals + MIDDLE
    aside = np.abs(local[:, :2]).max(axis=1) / safe
    unit = (focals[1] * (reach / safe) * (1 + aside) + WIDTH)[:, None] + 0 * exact
    depths = compare(depth[0], as_tensor(local[:, 2]), as_tensor(reach), 8 * EPSILON)
    wanted = np.where(behind[:, None], as_array(pixels[0]), exact)
    return Outcome(
        worst([depths, compare(pixels[0], as_tensor(wanted), as_tensor(unit), 8 * EPSILON)])
    )


def stand_on_ground(trial: Trial) -> Outcome:
    """Positions from boxes whose feet lie from straight below up to the horizon and above it."""
    generator = np.random.default_rng(trial.seed)
    scale, below = trial["scale"], trial["below"]
    place = np.array([1.0, -1.0, 0.0]) * trial["away"] * scale
    place[2] = scale * generator.uniform(0.5, 5)
    tilt = float(generator.uniform(-0.3, 0.3))
    cameras, rotation = camera_at(place, trial["focal"], float(generator.uniform(-3, 3)), tilt)
    # The foot's row at which its ray points so far below the horizontal.
    foot = MIDDLE[1] + trial["focal"] * 1.05 * math.tan(below - tilt)
    middle = MIDDLE[0] + trial["focal"] * 0.1
    box = np.array([middle - 4, foot - 20, middle + 4, foot])
    kind = BOXES[trial.count("box")]
    if kind == "flat":
        box[1] = box[3]
    elif kind == "inverted":
        box[[0, 2]] = box[[2, 0]]
    elif kind == "absent":
        box[:] = np.nan
    with trial.mixed():
        found, valid = locate(cameras, torch.from_numpy(box)[None, None], 0.1 * scale, 0.01 * scale)
    return Outcome(_stood(trial, (place, rotation), box, (found[0, 0], bool(valid[0, 0]))))


def _stood(
    trial: Trial, camera: tuple[np.ndarray, np.ndarray], box: np.ndarray, found: tuple[Tensor, bool]
) -> Measured:
    """Compare a position with the intersection in extended precision."""
    (place, rotation), (position, valid), scale = camera, found, trial["scale"]
    pixel = np.array([(box[0] + box[2]) / 2, box[3]], dtype=np.longdouble)
    focals = np.array([trial["focal"], trial["focal"] * 1.05], dtype=np.longdouble)
    direction = rotation @ np.array([*((pixel - MIDDLE) / focals), 1.0])
    length = np.sqrt((direction**2).sum())
    slope = float(-direction[2] / length)
    # How surely the slope is known: pixels far from the middle have few digits left.
    doubt = 16 * EPSILON * float(1 + np.abs(pixel).max() / trial["focal"]) / float(length)
    proper = BOXES[trial.count("box")] == "proper"
    meets = proper and slope > HORIZON
    if proper and abs(slope - HORIZON) <= doubt:
        return Measured(0.0, 1.0, int((~torch.isfinite(position)).sum()))
    if not meets or not valid:
        wrong = float(valid != meets) + float(position.abs().max()) * (not valid)
        return Measured(wrong, 0.0, int((~torch.isfinite(position)).sum()))
    ground = place[:2] + direction[:2] * (place[2] / -direction[2])
    away = ground - place[:2]
    away = away / max(float(np.sqrt((away**2).sum())), 1e-9)
    exact = np.array([*(ground + 0.1 * scale * away), 0.01 * scale], dtype=np.float64)
    reach = float(np.abs(place).max() + np.abs(exact).max() + scale)
    # Near the horizon a rounding of the slope moves the foot by its share of the slope.
    return compare(position, torch.from_numpy(exact), reach, SINGLE + doubt / slope)


def frame_volumes(trial: Trial) -> Outcome:
    """Image boxes of volumes before, around, beside and behind the camera."""
    generator = np.random.default_rng(trial.seed)
    scale = trial["scale"]
    low = torch.tensor([-0.7, -0.5, 0.0], dtype=torch.float64) * scale
    high = torch.tensor([0.7, 0.6, 1.9 * trial["height"]], dtype=torch.float64) * scale
    position = generator.normal(size=3) * scale * trial["away"]
    place = position + np.array([0.0, -trial["distance"], 0.8]) * scale
    cameras, rotation = camera_at(place, trial["focal"], *generator.uniform(-0.2, 0.2, 2))
    stands = torch.from_numpy(position)[None]
    with trial.mixed():
        whole, ahead = box_in_image(cameras, stands, low, high)
        seen, before = visible_box_in_image(cameras, stands, low, high)
    view = (position - place, rotation, trial["focal"])
    tight = _framed(corners(low, high), view, float(np.abs(place).max()))
    shown = _framed(outline(low, high), view, float(np.abs(place).max()))
    size = np.array([WIDTH, HEIGHT] * 2, dtype=np.float64)
    measured = [Measured(0.0, 1.0, int((~torch.isfinite(torch.cat([whole, seen]))).sum()))]
    if tight.all_ahead:
        measured.append(compare(whole[0], as_tensor(tight.box), tight.doubt, 8 * EPSILON))
        measured.append(Measured(float(not ahead[0]), 0.0))
    if shown.sure and bool(before[0]):
        wanted = as_tensor(np.clip(shown.box, 0, size))
        measured.append(compare(seen[0], wanted, shown.doubt, 8 * EPSILON))
    return Outcome(worst(measured))


@dataclass(frozen=True)
class _Framed:
    """What extended precision says of points in a picture.

    Attributes:
        box: (left, top, right, bottom) of the points before the camera, pixels.
        doubt: Pixels by which it changes where coordinates change by their own size.
        all_ahead: Whether all points are well before the camera.
        sure: Whether none is so near to its plane that float64 may have it on the other side.
    """

    box: np.ndarray
    doubt: float
    all_ahead: bool
    sure: bool


def _framed(points: Tensor, view: tuple, reach: float) -> _Framed:
    offset, rotation, focal = view
    local = (points.numpy().astype(np.longdouble) + offset) @ rotation
    depth, nearest = local[:, 2], 1e-2 * np.abs(points.numpy()).max()
    front = depth > 0
    safe = np.where(front, depth, 1.0)[:, None]
    pixels = local[:, :2] / safe * np.array([focal, focal * 1.05]) + MIDDLE
    first = np.where(front[:, None], pixels, np.inf).min(axis=0)
    last = np.where(front[:, None], pixels, -np.inf).max(axis=0)
    reach = reach + np.abs(points.numpy()).max()
    aside = 1 + np.abs(local[:, :2]).max(axis=1) / safe[:, 0]
    doubts = np.where(front, focal * 1.05 * aside * reach / safe[:, 0], 0.0)
    box = np.concatenate([first, last])
    sure = bool((np.abs(depth) > 1e-9 * reach).all())
    return _Framed(box, float(doubts.max()) + WIDTH, bool((depth > nearest).all()), sure)


_FOCALS = Spread((1e-3, 1.0, 600.0, 1e9))
_SCALES = Spread((1e-3, 1.0, 1e6))
_AWAY = Spread((0.0, 1.0, 1e5))

CAMERAS = (
    Case(
        "pixels to rays",
        {"focal": _FOCALS},
        shoot_rays,
        "8 eps of a ray's length, and of the pixels' size by focal length",
        ("float64", "float32", "bfloat16"),
        draws=8,
    ),
    Case(
        "points to pixels",
        {"focal": _FOCALS, "scale": _SCALES, "away": _AWAY},
        project_points,
        "8 eps64 of the distance from the origin, as the picture magnifies it",
        ("float64", "bfloat16"),
    ),
    Case(
        "feet on the ground",
        {
            "below": Spread((-0.2, 0.0, 1e-7, 1.1e-6, 1e-5, 1e-2, 0.5, 1.3), "linear"),
            "focal": _FOCALS,
            "scale": _SCALES,
            "away": _AWAY,
            "box": one_of(BOXES),
        },
        stand_on_ground,
        "1 eps32 of the distance, plus 16 eps64 by the slope of the foot's ray",
        ("float64", "bfloat16"),
        draws=24,
        examples=40,
    ),
    Case(
        "volumes in the picture",
        {
            "distance": Spread((-3.0, 0.0, 0.5, 0.7, 2.0, 1e5), "linear"),
            "focal": _FOCALS,
            "scale": _SCALES,
            "away": _AWAY,
            "height": Spread((1e-9, 1.0)),
        },
        frame_volumes,
        "8 eps64 of the distance from the origin, as the picture magnifies it",
        ("float64", "bfloat16"),
        draws=24,
    ),
)
