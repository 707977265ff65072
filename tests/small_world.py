"""A tiny environment with untrained networks: a court, a wall, a sky and (by default) two players.

Everything is small enough that a test is a matter of milliseconds, and nothing is symmetric, so
that swapped axes, frames or objects show.
"""

import math
from dataclasses import replace

import numpy as np
import torch

from pe_runtime.action.module import ActionModule
from pe_runtime.config import (
    ActionConfig,
    BendingConfig,
    EncoderConfig,
    FeatureRendererConfig,
    FieldConfig,
    ModelConfig,
    ObjectClassConfig,
    ObjectConfig,
    SynthesisConfig,
)
from pe_runtime.contract.camera import Camera, project
from pe_runtime.dataset import Clips
from pe_runtime.environment import PlayableEnvironment
from pe_runtime.geometry.cameras import Cameras, ray_directions
from pe_runtime.networks import Codes, SynthesisNetworks
from pe_runtime.rendering.scene import Rays

WIDTH, HEIGHT = 32, 16
ACTIONS = ("idle", "left", "right")
FIELD = FieldConfig(width=12, depth=3, skip=2, octaves=3, head_width=8)
FRAME = EncoderConfig(crop="frame", height=8, width=16, channels=(4, 8), hidden=8)

GROUND = ObjectClassConfig(
    low=(-5.0, -5.0, -0.02),
    high=(5.0, 4.0, 0.0),
    axes=(0, 1),
    samples=1,
    opaque=True,
    style_features=4,
    field=FIELD,
    encoder=FRAME,
)
BACKDROP = replace(GROUND, low=(-5.0, 0.0, 0.0), high=(5.0, 0.05, 1.5), axes=(0, 2))
SKY = replace(GROUND, kind="sky", axes=(0, 1, 2), style_features=3)
PLAYER = ObjectClassConfig(
    kind="playable",
    low=(-0.5, -0.6, 0.0),
    high=(0.6, 0.5, 1.7),
    samples=5,
    style_features=5,
    pose_features=3,
    foot_offset=0.1,
    field=replace(FIELD, skip=0),
    bending=BendingConfig(width=8, depth=2, octaves=2, output_scale=0.1),
    encoder=EncoderConfig(crop="volume", height=16, width=12, channels=(4, 8), hidden=8),
)


def small_config(players=2, width=WIDTH, height=HEIGHT, **player):
    """The environment; further arguments change the class `player`."""
    statics = (
        ObjectConfig("ground", "ground"),
        ObjectConfig("backdrop", "backdrop", (0.0, 4.0, 0.0)),
        ObjectConfig("sky", "sky"),
    )
    return ModelConfig(
        name="small",
        width=width,
        height=height,
        classes={
            "ground": GROUND,
            "backdrop": BACKDROP,
            "sky": SKY,
            "player": replace(PLAYER, **player),
        },
        objects=(*statics, *(ObjectConfig(f"player_{i + 1}", "player") for i in range(players))),
        feature_renderer=FeatureRendererConfig(
            strides=(2, 4), features=(5, 4), widths=(8, 8), output_widths=(8,)
        ),
        action=ActionConfig(
            actions=len(ACTIONS), variability=2, hidden=8, dynamics_width=8, discriminator_width=8
        ),
    )


def small_networks(config=None, seed=0):
    """Networks in evaluation mode whose weights, also those that start at zero, are random."""
    torch.manual_seed(seed)
    networks = SynthesisNetworks(config or small_config())
    shake(networks)
    return networks.eval()


def shake(module, amount=0.1):
    """Move every parameter and running mean away from where it starts."""
    with torch.no_grad():
        for parameter in module.parameters():
            parameter += amount * torch.randn_like(parameter)
        for name, buffer in module.named_buffers():
            if name.endswith("running_mean"):
                buffer += amount * torch.randn_like(buffer)


def small_environment(config=None, seed=0, actions=True):
    config = config or small_config()
    networks = small_networks(config, seed)
    player = config.classes["player"]
    module = ActionModule(config.action, player.style_features, player.pose_features)
    shake(module)
    modules = {"player": module} if actions else {}
    header = {"kind": "model", "action_names": {"player": list(ACTIONS)}}
    return PlayableEnvironment(config, networks, modules, header)


def camera(azimuth=0.2, distance=5.0, height=1.6, width=WIDTH, rows=HEIGHT, focal=None):
    """Looks from the front (y < 0) at a point half a metre above the origin."""
    position = (distance * math.sin(azimuth), -distance * math.cos(azimuth), height)
    return look_at(position, (0.0, 0.0, 0.5), width, rows, focal)


def look_at(position, target, width=WIDTH, height=HEIGHT, focal=None):
    """A camera without roll; the focal length defaults to the image's width in pixels."""
    position = np.asarray(position, dtype=float)
    forward = np.asarray(target, dtype=float) - position
    forward = forward / np.linalg.norm(forward)
    right = np.cross(forward, [0.0, 0.0, 1.0])
    right = right / np.linalg.norm(right)
    pose = np.eye(4)
    pose[:3, :3] = np.stack([right, np.cross(forward, right), forward], axis=1)
    pose[:3, 3] = position
    focal = focal or float(width)
    # The principal point is off the middle, as in a cropped picture.
    intrinsics = [[focal, 0, width / 2 + 0.7], [0, focal * 1.05, height / 2 - 0.4], [0, 0, 1]]
    return Camera(width, height, np.array(intrinsics), pose)


def rays_of(views, per_frame=12, seed=0):
    """Rays through random pixels of every camera."""
    cameras = Cameras.stack(views)
    generator = torch.Generator().manual_seed(seed)
    frame = torch.arange(len(views)).repeat_interleave(per_frame)
    size = torch.tensor([cameras.width, cameras.height], dtype=torch.float64)
    pixels = torch.rand(len(frame), 2, generator=generator, dtype=torch.float64) * size
    return Rays(cameras.centres, ray_directions(cameras, frame, pixels), frame)


def random_codes(config, frames=1, seed=0, places=((-0.7, 0.1, 0.0), (0.8, -0.2, 0.0))):
    """States of every object: statics in their place, players at `places`, all codes random."""
    generator = torch.Generator().manual_seed(seed)
    codes, standing = {}, iter(places)
    for each in config.objects:
        kind = config.classes[each.class_name]
        at = next(standing) if kind.kind == "playable" else each.position
        codes[each.name] = Codes(
            torch.tensor(at).expand(frames, 3),
            torch.randn(frames, kind.style_features, generator=generator),
            torch.randn(frames, kind.pose_features, generator=generator),
            torch.ones(frames, dtype=torch.bool),
        )
    return codes


def box_of(position, view, half=0.35, tall=1.6):
    """(left, top, right, bottom), pixels, of a standing card that faces the camera."""
    base = np.asarray(position, dtype=float)
    side = view.world_from_camera[:3, 0] * half
    pixels, _ = project(view, np.stack([base - side, base + side, base + [0, 0, tall]]))
    return (pixels[0, 0], pixels[2, 1], pixels[1, 0], pixels[:2, 1].max())


def picture_of(positions, view, shades):
    """Sky over ground, and a card per player, as (height, width, 3) float32."""
    rows = np.linspace(0.8, 0.3, view.height, dtype=np.float32)[:, None, None]
    picture = np.tile(rows * np.array([0.6, 0.8, 1.0], dtype=np.float32), (1, view.width, 1))
    for position, shade in zip(positions, shades, strict=True):
        left, top, right, bottom = (max(0, round(edge)) for edge in box_of(position, view))
        picture[top:bottom, left:right] = shade
    return picture


def small_clips(count=2, frames=4, width=40, height=24, players=2, seed=0):
    """Sequences of walking cards under a turning camera."""
    rng = np.random.default_rng(seed)
    shape = (count, frames)
    images = np.zeros((*shape, height, width, 3), dtype=np.uint8)
    intrinsics, poses = np.zeros((*shape, 3, 3)), np.zeros((*shape, 4, 4))
    boxes = np.zeros((*shape, players, 4), dtype=np.float32)
    positions = np.zeros((*shape, players, 3), dtype=np.float32)
    for clip in range(count):
        shades = rng.random((players, 3)).astype(np.float32)
        for time in range(frames):
            view = camera(0.1 * time - 0.25 * clip, width=width, rows=height)
            positions[clip, time, :, 0] = np.linspace(-0.9, 0.9, players) + 0.1 * time
            picture = picture_of(positions[clip, time], view, shades)
            images[clip, time] = np.round(picture * 255)
            intrinsics[clip, time], poses[clip, time] = view.intrinsics, view.world_from_camera
            for player in range(players):
                boxes[clip, time, player] = box_of(positions[clip, time, player], view)
    return Clips(
        torch.from_numpy(images),
        torch.from_numpy(intrinsics),
        torch.from_numpy(poses),
        torch.from_numpy(boxes),
        torch.from_numpy(positions),
        torch.full((count, frames - 1, players), -1),
        tuple(f"player_{i + 1}" for i in range(players)),
    )


def small_training(**changes):
    """Training settings for `small_clips`."""
    settings = {
        "steps": 30,
        "sequences": 2,
        "frames": 2,
        "patch_height": 16,
        "patch_width": 16,
        "warmup": 2,
        "bfloat16": False,
        "evaluate_every": 0,
        "checkpoint_every": 1000,
    }
    return SynthesisConfig(**settings | changes)
