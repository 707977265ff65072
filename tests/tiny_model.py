"""A model of few weights, untrained, and a recorded clip of its size: real parts, small numbers."""

import numpy as np
import torch

from pe_runtime.action.module import ActionModule
from pe_runtime.checkpoint import save_checkpoint
from pe_runtime.config import ModelConfig, as_dict, from_dict
from pe_runtime.contract.camera import Camera, project
from pe_runtime.contract.episode import DatasetInfo, EpisodeArrays, write_dataset, write_episode
from pe_runtime.images import write_png
from pe_runtime.networks import SynthesisNetworks

WIDTH, HEIGHT = 32, 16
ACTIONS = ("idle", "left", "right")
PLACES = {"player_1": (-1.0, 0.0, 0.0), "player_2": (1.0, 0.5, 0.0)}
FIELD = {"width": 8, "depth": 2, "octaves": 2, "head_width": 8}
ENCODER = {"height": 8, "width": 8, "channels": (4, 4), "hidden": 8}


def tiny_config(players=tuple(PLACES)):
    ground = {
        "low": (-14.0, -12.0, -0.02),
        "high": (14.0, 9.0, 0.0),
        "axes": (0, 1),
        "samples": 1,
        "opaque": True,
        "style_features": 4,
        "field": FIELD,
        "encoder": ENCODER | {"crop": "frame"},
    }
    player = {
        "kind": "playable",
        "samples": 4,
        "style_features": 4,
        "pose_features": 3,
        "field": FIELD,
        "bending": {"width": 8, "depth": 2, "octaves": 2},
        "encoder": ENCODER,
    }
    objects = [{"name": "ground", "class_name": "ground"}]
    objects += [{"name": name, "class_name": "player"} for name in players]
    return from_dict(
        ModelConfig,
        {
            "name": "tiny",
            "width": WIDTH,
            "height": HEIGHT,
            "classes": {"ground": ground, "player": player},
            "objects": objects,
            "feature_renderer": {
                "strides": (2, 4),
                "features": (4, 4),
                "widths": (4, 4),
                "output_widths": (4,),
            },
            "action": {"actions": len(ACTIONS), "hidden": 8, "dynamics_width": 8},
        },
    )


def write_model(path, players=tuple(PLACES), seed=0):
    torch.manual_seed(seed)
    config = tiny_config(players)
    networks = SynthesisNetworks(config)
    tensors = {f"synthesis.{name}": each for name, each in networks.state_dict().items()}
    module = ActionModule(config.action, 4, 3)
    tensors |= {f"actions.player.{name}": each for name, each in module.state_dict().items()}
    facts = {"kind": "model", "config": as_dict(config), "action_names": {"player": list(ACTIONS)}}
    save_checkpoint(path, tensors, facts)
    return str(path)


def camera(x=0.0, width=WIDTH, height=HEIGHT):
    """At 8 m before the origin, 2 m up, looking along +y and a little down."""
    view = np.array([0.0, 1.0, -0.125]) / np.hypot(1.0, 0.125)
    pose = np.eye(4)
    pose[:3, 0], pose[:3, 1], pose[:3, 2] = [1, 0, 0], np.cross(view, [1.0, 0, 0]), view
    pose[:3, 3] = [x, -8.0, 2.0]
    focal = 1.1 * width
    intrinsics = np.array([[focal, 0, width / 2], [0, focal, height / 2], [0, 0, 1.0]])
    return Camera(width, height, intrinsics, pose)


def boxes():
    found = {}
    for name, place in PLACES.items():
        ((x, y),), _ = project(camera(), np.array([place]))
        found[name] = (float(x) - 2.0, float(y) - 7.0, float(x) + 2.0, float(y))
    return found


def write_clip(root, frames=3):
    """A data set of one clip of noise whose boxes stand on the ground."""
    info = DatasetInfo("tiny", 0, 1, 5.0, WIDTH, HEIGHT, tuple(PLACES), ACTIONS, 1)
    write_dataset(root, info)
    rng = np.random.default_rng(0)
    for frame in range(frames):
        path = root / "00000" / "frames" / "0" / f"{frame:04d}.png"
        path.parent.mkdir(parents=True, exist_ok=True)
        write_png(path, rng.integers(0, 256, (HEIGHT, WIDTH, 3), dtype=np.uint8))
    box = np.array(list(boxes().values()), np.float32)
    arrays = EpisodeArrays(
        intrinsics=np.tile(camera().intrinsics, (1, frames, 1, 1)),
        world_from_camera=np.tile(camera().world_from_camera, (1, frames, 1, 1)),
        boxes=np.tile(box, (1, frames, 1, 1)),
        present=np.ones((1, frames, 2), bool),
        positions=np.tile(np.array(list(PLACES.values())), (frames, 1, 1)),
        actions=np.zeros((frames - 1, 2), np.int8),
    )
    write_episode(root / "00000", info, arrays, {})
    return root
