"""A tiny world and a model that knows it: two coloured cards that walk on the ground.

A card's grey is its pose, its blue its style; what the model draws is what the recorder wrote, up
to 8 bits.
"""

import json
from dataclasses import dataclass, field, replace

import numpy as np
import torch

from pe_runtime.contract.camera import Camera, project
from pe_runtime.contract.episode import DatasetInfo, EpisodeArrays, write_dataset, write_episode
from pe_runtime.images import write_png
from pe_runtime.kept_frames import Frame
from pe_runtime.state import EnvironmentState, ObjectState

WIDTH, HEIGHT, FRAMES = 48, 32, 6
PLAYERS = ("left", "right")
# Right and forward of the camera, metres: idle, left, right, forward.
STEPS = np.array([[0.0, 0.0], [-0.3, 0.0], [0.3, 0.0], [0.0, 0.3]])
NAMES = ("idle", "left", "right", "forward")
BACKGROUND = 0.2


def find_cards(picture):
    """Pixels that show a card."""
    return np.abs(picture - BACKGROUND).max(axis=-1) > 0.05


def camera(azimuth=0.0, distance=8.0):
    """Level, 1 m high, looking at the origin from `azimuth` (radians) beside -y."""
    sin, cos = np.sin(azimuth), np.cos(azimuth)
    pose = np.eye(4)
    pose[:3, 0], pose[:3, 1], pose[:3, 2] = (cos, sin, 0), (0, 0, -1), (-sin, cos, 0)
    pose[:3, 3] = (distance * sin, -distance * cos, 1.0)
    intrinsics = np.array([[40.0, 0, WIDTH / 2], [0, 40.0, HEIGHT / 2], [0, 0, 1]])
    return Camera(WIDTH, HEIGHT, intrinsics, pose)


def right_and_forward(view):
    return view.world_from_camera[:2, [0, 2]]


def box_of(position, view):
    """The card's box: 0.8 m wide and 1.6 m tall above its foot."""
    (pixel,), (depth,) = project(view, np.asarray(position)[None])
    half, tall = 40.0 * 0.4 / depth, 40.0 * 1.6 / depth
    return (pixel[0] - half, pixel[1] - tall, pixel[0] + half, pixel[1])


def boxes_of(positions, view):
    return [box_of(position, view) for position in positions]


def draw(cards, view):
    """Paint (position, grey, blue) cards on the background."""
    picture = np.full((HEIGHT, WIDTH, 3), BACKGROUND, dtype=np.float32)
    for position, grey, blue in cards:
        picture[covered(position, view)] = (grey, grey, blue)
    return picture


def covered(position, view):
    """Rows and columns of a card."""
    left, top, right, bottom = (round(max(edge, 0)) for edge in box_of(position, view))
    return slice(top, bottom), slice(left, right)


def mask(position, view):
    shown = np.zeros((HEIGHT, WIDTH), dtype=np.float32)
    shown[covered(position, view)] = 1.0
    return shown


@dataclass
class ToyEnvironment:
    """Encodes, moves and draws cards without a mistake, unless told to make one."""

    playable_names: tuple = PLAYERS
    actions: dict = field(default_factory=lambda: {"card": None})
    action_names: dict = field(default_factory=lambda: dict.fromkeys(PLAYERS, NAMES))
    pose_is_drawn: bool = True
    always: int | None = None
    drift: float = 0.0

    def encode(self, image, camera, boxes):
        objects = {}
        for name, box in boxes.items():
            left, top, right, bottom = box
            grey, _, blue = image[round((top + bottom) / 2), round((left + right) / 2)]
            foot = np.array([(left + right) / 2, bottom, 1.0])
            ray = camera.world_from_camera[:3, :3] @ np.linalg.inv(camera.intrinsics) @ foot
            origin = camera.world_from_camera[:3, 3]
            objects[name] = card(origin - ray * origin[2] / ray[2], grey, blue)
        return EnvironmentState(objects)

    def step(self, state, actions, camera, memory=None):
        objects = dict(state.objects)
        for name, action in actions.items():
            move = right_and_forward(camera) @ (STEPS[action] + [self.drift, 0.0])
            position = objects[name].position + torch.tensor([*move, 0.0]).float()
            objects[name] = replace(objects[name], position=position)
        return EnvironmentState(objects), (memory or 0) + 1

    def infer_actions(self, states, cameras):
        return {name: self._infer(name, states, cameras) for name in self.playable_names}

    def _infer(self, name, states, cameras):
        if self.always is not None:
            return np.full(len(states) - 1, self.always)
        places = np.array([state[name].position.numpy() for state in states], dtype=float)
        moves = zip(cameras[:-1], np.diff(places, axis=0), strict=True)
        seen = np.array([right_and_forward(view).T @ move[:2] for view, move in moves])
        distances = np.linalg.norm(seen[:, None] - STEPS[None], axis=-1)
        return distances.argmin(1)

    def render(self, state, camera, options=None):
        places = {n: each.position.numpy().astype(float) for n, each in state.objects.items()}
        cards = [
            (places[n], float(each.pose[0]) * self.pose_is_drawn, float(each.style[0]))
            for n, each in state.objects.items()
        ]
        names = options.masks if options is not None else ()
        masks = {name: mask(places[name], camera) for name in names}
        return Frame(draw(cards, camera), masks=masks)


def card(position, grey, blue):
    position = torch.tensor(np.asarray(position), dtype=torch.float32)
    return ObjectState(position, torch.tensor([float(blue)]), torch.tensor([float(grey)]))


def record(root, sequences=4, views=2, frames=FRAMES, seed=0, absent=()):
    """Write a data set of cards on random walks; `absent` lists (sequence, frame, player)."""
    info = DatasetInfo(
        "toy", seed, sequences, 5.0, WIDTH, HEIGHT, PLAYERS, ("idle", "l", "r", "f"), views
    )
    write_dataset(root, info)
    rng = np.random.default_rng(seed)
    for number in range(sequences):
        hidden = [(frame, player) for where, frame, player in absent if where == number]
        write_one(root / f"{number:05d}", info, rng, frames, hidden)
    return root


def write_one(path, info, rng, frames, hidden):
    cameras = [[camera(0.1 * t + 0.4 * v) for t in range(frames)] for v in range(info.views)]
    actions = rng.integers(0, len(STEPS), size=(frames - 1, len(PLAYERS)))
    positions = walk(actions, cameras[0])
    greys = 0.4 + 0.6 * rng.random((frames, len(PLAYERS)))
    blues = 0.5 + 0.5 * rng.random(len(PLAYERS))
    boxes = np.array([[boxes_of(positions[t], row[t]) for t in range(frames)] for row in cameras])
    present = np.ones(boxes.shape[:3], dtype=bool)
    for frame, player in hidden:
        present[:, frame, PLAYERS.index(player)] = False
    boxes[~present] = np.nan
    for v, row in enumerate(cameras):
        for t, view in enumerate(row):
            seen = np.flatnonzero(present[v, t])
            cards = [(positions[t, player], greys[t, player], blues[player]) for player in seen]
            file = path / "frames" / str(v) / f"{t:04d}.png"
            file.parent.mkdir(parents=True, exist_ok=True)
            write_png(file, draw(cards, view))
    arrays = EpisodeArrays(
        np.array([[c.intrinsics for c in row] for row in cameras]),
        np.array([[c.world_from_camera for c in row] for row in cameras]),
        boxes.astype(np.float32),
        present,
        positions,
        actions.astype(np.int8),
    )
    write_episode(path, info, arrays, {})


def walk(actions, cameras):
    """True positions (frames, players, 3) under camera-relative actions."""
    positions = [np.array([[-1.0, 0.0, 0.0], [1.0, 0.0, 0.0]])]
    for chosen, view in zip(actions, cameras[:-1], strict=True):
        move = np.zeros((len(PLAYERS), 3))
        move[:, :2] = STEPS[chosen] @ right_and_forward(view).T
        positions.append(positions[-1] + move)
    return np.array(positions)


def plain(report):
    """A report as JSON would hand it on."""
    return json.loads(json.dumps(report))
