"""Stress of the encoders: odd boxes, far and near objects, still pictures, batches of one.

The truth is the same modules in float64.
"""

import copy
import math
from dataclasses import replace

import torch
from torch import Tensor

from pe_runtime.benchmark.stress_cases import (
    Case,
    Outcome,
    Spread,
    Trial,
    compare,
    finite,
    gradients,
    one_of,
    worst,
)
from pe_runtime.config import (
    EncoderConfig,
    FeatureRendererConfig,
    FieldConfig,
    ModelConfig,
    ObjectClassConfig,
    ObjectConfig,
)
from pe_runtime.geometry.cameras import Cameras
from pe_runtime.networks import Codes, SynthesisNetworks

WIDTH, HEIGHT, FOCAL = 32, 16, 30.0
DESIGNS = ("compact", "residual", "attentive")
BOXES = ("ordinary", "partly outside", "outside", "a dot", "at the horizon", "absent", "inverted")
PICTURES = ("noise", "grey", "black")
MODES = ("playing", "training")


def encode_pictures(trial: Trial) -> Outcome:
    """Styles, poses and headings of a ground and a player, and their gradients."""
    networks = _networks(trial)
    precise = _in_double(networks)
    frames = trial.count("frames")
    generator = trial.generator()
    images = {
        "noise": torch.rand(frames, 3, HEIGHT, WIDTH, generator=generator),
        "grey": torch.full((frames, 3, HEIGHT, WIDTH), 0.5),
        "black": torch.zeros(frames, 3, HEIGHT, WIDTH),
    }[PICTURES[trial.count("picture")]]
    given = _cameras(frames, trial["scale"]), _boxes(trial, frames)
    with trial.mixed():
        found = networks.encode(images, *given)
    with torch.no_grad():
        truth = precise.encode(images.double(), *given)
    # Normalisations divide by a deviation of as little as the root of their 1e-5.
    bound = min(4 * trial.epsilon / math.sqrt(1e-5), 0.125)
    results, total = [], torch.zeros(())
    for name, codes in found.items():
        for code, exact in zip(_codes(codes), _codes(truth[name]), strict=True):
            size = 1 + float(exact.abs().max()) if exact.numel() else 1.0
            results.append(compare(code, exact, size, bound))
            total = total + code.sum()
    return Outcome(worst(results), finite(*gradients(total, list(networks.parameters()))))


def _in_double(networks: SynthesisNetworks) -> SynthesisNetworks:
    precise = copy.deepcopy(networks).double()
    for module in precise.modules():
        # Codes are float32 from here on, whatever the encoder computes in.
        if isinstance(module, torch.nn.BatchNorm1d):
            module.float()
    return precise


def _codes(codes: Codes) -> list[Tensor]:
    seen = codes.visible[:, None]
    found = [torch.where(seen, each, 0.0) for each in (codes.style, codes.pose)]
    if codes.heading is not None:
        turned = torch.stack([codes.heading.sin(), codes.heading.cos()], dim=1)
        found.append(torch.where(seen, turned, 0.0))
    return [*found, codes.position / (1 + codes.position.detach().abs().max())]


def _networks(trial: Trial) -> SynthesisNetworks:
    design, scale = DESIGNS[trial.count("design")], trial["scale"]
    residual = design != "compact"
    encoder = EncoderConfig(
        design=design,
        crop="box" if residual else "volume",
        resampling="max" if residual else "bilinear",
        view="camera" if residual else "direction",
        height=16,
        width=16,
        channels=(4, 8),
        hidden=8,
    )
    low, high = (-0.5 * scale, -0.5 * scale, 0.0), (0.5 * scale, 0.5 * scale, 1.75 * scale)
    field = FieldConfig(width=4, depth=1, octaves=1, head_width=4)
    player = ObjectClassConfig(
        kind="playable",
        low=low,
        high=high,
        style_features=4,
        pose_features=3,
        field=field,
        encoder=encoder,
        heading=replace(encoder, design="residual", crop="box") if residual else None,
    )
    whole = replace(encoder, design="compact", view="none", crop="visible-volume")
    ground = ObjectClassConfig(low=low, high=high, style_features=4, field=field, encoder=whole)
    config = ModelConfig(
        name="stress",
        width=WIDTH,
        height=HEIGHT,
        classes={"ground": ground, "player": player},
        objects=(ObjectConfig("ground", "ground"), ObjectConfig("player", "player")),
        feature_renderer=FeatureRendererConfig(
            strides=(2, 4), features=(4, 4), widths=(4, 4), output_widths=(4,)
        ),
    )
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(trial.seed)
        networks = SynthesisNetworks(config)
    return networks.train(MODES[trial.count("mode")] == "training")


def _cameras(frames: int, scale: float) -> Cameras:
    """Level cameras before the player, which is out of view of none."""
    pose = torch.eye(4, dtype=torch.float64)
    pose[:3, :3] = torch.tensor([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])
    pose[:3, 3] = torch.tensor([0.0, -3.0, 1.0]) * scale
    intrinsics = torch.tensor([[FOCAL, 0, WIDTH / 2], [0, FOCAL, HEIGHT / 2], [0, 0, 1.0]])
    poses = pose.expand(frames, -1, -1)
    return Cameras(WIDTH, HEIGHT, intrinsics.double().expand(frames, -1, -1), poses)


def _boxes(trial: Trial, frames: int) -> Tensor:
    box = {
        "ordinary": (10.0, 3.0, 20.0, 14.0),
        "partly outside": (-6.0, -4.0, 9.0, 22.0),
        "outside": (200.0, 3.0, 210.0, 14.0),
        "a dot": (10.0, 13.0, 10.0 + 1e-4, 13.0 + 1e-4),
        "at the horizon": (10.0, 3.0, 20.0, HEIGHT / 2 + 2e-4),
        "absent": (math.nan,) * 4,
        "inverted": (20.0, 14.0, 10.0, 3.0),
    }[BOXES[trial.count("box")]]
    return torch.tensor(box, dtype=torch.float32).expand(frames, 1, 4)


PERCEPTION = (
    Case(
        "encoders: odd boxes, still pictures, batch 1",
        {
            "design": one_of(DESIGNS),
            "box": one_of(BOXES),
            "picture": one_of(PICTURES),
            "mode": one_of(MODES),
            "frames": Spread((1.0, 3.0), "whole"),
            "scale": Spread((1e-3, 1.0, 1e6)),
        },
        encode_pictures,
        "4 eps of the codes by the least deviation of a normalisation; at most 0.125",
        draws=6,
        examples=8,
    ),
)
