"""Folders as the authors' release lays them out, small and made up, with its pickled classes.

The pose classes must be pickled under the release's own path, so modules of that name exist while
files are written, and only then: what reads them must not find them.
"""

import math
import pickle
import sys
from contextlib import contextmanager
from types import ModuleType

import numpy as np

from pe_runtime.contract.episode import read_dataset, read_episode
from pe_runtime.images import write_png
from pe_runtime.interop.dataset_plan import ImportOptions
from pe_runtime.interop.official_dataset import import_dataset

PATH = "utils.lib_3d.pose_parameters"
SIZE = (64, 36)
MULTIPLIERS = {"tennis": 0.51417, "minecraft": 0.5}


class PoseParametersNumpy:
    def __init__(self, rotation, translation):
        self.rotation, self.translation = rotation, translation


class PoseParameters(PoseParametersNumpy):
    pass


@contextmanager
def release_modules():
    """The release's module path, for as long as something is pickled."""
    names = ["utils", "utils.lib_3d", PATH]
    before = {name: sys.modules.get(name) for name in names}
    for name in names:
        sys.modules[name] = ModuleType(name)
    for each in (PoseParametersNumpy, PoseParameters):
        each.__module__ = PATH
        setattr(sys.modules[PATH], each.__name__, each)
    try:
        yield
    finally:
        for name, module in before.items():
            sys.modules.pop(name)
            if module is not None:
                sys.modules[name] = module


def dumps(value, protocol=4):
    with release_modules():
        return pickle.dumps(value, protocol)


def pose(angles, translation):
    return PoseParametersNumpy(np.float32(angles), np.float32(translation))


def rotation(a, b, c):
    """R = Ry(b) Rx(a) Rz(c), written out once more."""
    about_x = [[1, 0, 0], [0, math.cos(a), -math.sin(a)], [0, math.sin(a), math.cos(a)]]
    about_y = [[math.cos(b), 0, math.sin(b)], [0, 1, 0], [-math.sin(b), 0, math.cos(b)]]
    about_z = [[math.cos(c), -math.sin(c), 0], [math.sin(c), math.cos(c), 0], [0, 0, 1]]
    return np.array(about_y) @ np.array(about_x) @ np.array(about_z)


def filmed(world, frames, view=0):
    """Cameras, focal lengths and places of two players in a world of the release.

    Returns angles (T, 3), translations (T, 3), focals (T,), feet (T, 2, 3), their world, metres.
    """
    t = np.arange(frames)[:, None]
    if world == "tennis":
        angles = [1.3743, 0.0, 0.02] + t * [0.0, 0.004, 0.003]
        translations = [0.4 + view, -36.0, 9.0] + t * [0.05, 0.0, 0.01]
        feet = [[-2.0, -11.0, 0.0], [1.5, 10.0, 0.0]] + t[..., None] * [0.2, 0.1, 0.0]
        focal = 2200.0
    else:
        angles = [-0.35, 0.5 + 0.2 * view, 0.0] + t * [0.0, 0.01, 0.0]
        translations = [3.5, 3.2, 6.5] + t * [0.02, 0.0, 0.03]
        feet = [[-0.8, 0.0, 0.6], [1.2, 0.0, -0.7]] + t[..., None] * [0.1, 0.0, -0.1]
        focal = 900.0
    return angles, translations, focal + np.arange(frames), feet


def seen(angles, translation, focal, points, multiplier):
    """Where points appear, as shares of the picture, by the release's conventions."""
    local = (np.asarray(points) - translation) @ rotation(*angles)
    scaled = focal * multiplier
    u = -local[:, 0] / local[:, 2] * scaled + 256
    v = local[:, 1] / local[:, 2] * scaled + 144
    return np.stack([u / 512, v / 288], axis=1)


def annotations(world="tennis", frames=5, view=0, seed=0):
    """Every pickle of a camera, by name, before it is written."""
    angles, translations, focals, feet = filmed(world, frames, view)
    boxes = []
    for t in range(frames):
        foot = seen(angles[t], translations[t], focals[t], feet[t], MULTIPLIERS[world])
        half, tall = (0.03, 0.2)
        sides = [foot[:, 0] - half, foot[:, 1] - tall, foot[:, 0] + half, foot[:, 1]]
        boxes.append(np.stack(sides))
    rng = np.random.default_rng(seed)
    return {
        "cameras": [pose(a, p) for a, p in zip(angles, translations, strict=True)],
        "focals": focals.tolist(),
        "bounding_boxes": boxes,
        "bounding_box_validity": [np.ones(2, bool) for _ in range(frames)],
        "actions": rng.permutation(np.arange(frames) % 7).tolist(),
        "rewards": [0.5] * frames,
        "dones": [False] * (frames - 1) + [True],
        "metadata": [{"time": t / 5, "tag": np.float32(t)} for t in range(frames)],
    }


def write_camera(folder, pickles, frames=5, size=SIZE, seed=0, protocol=4):
    """Pictures of noise and pickles; a pickle that is None is left out, bytes are written as is."""
    folder.mkdir(parents=True)
    rng = np.random.default_rng(seed)
    for frame in range(frames):
        picture = rng.integers(0, 256, (size[1], size[0], 3), dtype=np.uint8)
        write_png(folder / f"{frame:05d}.png", picture)
    for name, value in pickles.items():
        if value is not None:
            content = value if isinstance(value, bytes) else dumps(value, protocol)
            (folder / f"{name}.pkl").write_bytes(content)


def write_sequence(folder, world="tennis", frames=5, views=1, seed=0, size=SIZE, **changes):
    """A sequence; further arguments replace pickles of its first camera."""
    for view in range(views):
        pickles = annotations(world, frames, view, seed) | (changes if view == 0 else {})
        write_camera(folder / f"{view:05d}", pickles, frames, size, seed)
    return folder


def write_split(folder, count=2, **options):
    for number in range(count):
        write_sequence(folder / f"{number:05d}", seed=number, **options)
    return folder


class Spy:
    """Pickles as a call of `function(*arguments)`."""

    def __init__(self, function, *arguments):
        self.call = (function, arguments)

    def __reduce__(self):
        return self.call


def files_below(folder):
    """Bytes of all files below a folder, hidden ones included, by relative path."""
    paths = [path for path in folder.rglob("*") if path.is_file()]
    return {str(path.relative_to(folder)): path.read_bytes() for path in paths}


def options(**changes):
    """Import options at the size of the pictures."""
    return ImportOptions(**{"size": SIZE} | changes)


def imported(root, output, **changes):
    """The report on the only split, and its episodes."""
    report = import_dataset(root, output, options(**changes))
    (split,) = report.splits
    return split, [read_episode(path) for path in read_dataset(split.folder)[1]]
