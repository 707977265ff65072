"""Imported fields compute what the authors' do: one ray against a loop-written twin."""

import math
from dataclasses import replace

import numpy as np
import pytest
import torch
from interop.release_twin import TwinObject, along_ray

from pe_runtime.config import BendingConfig, FieldConfig, ModelConfig, ObjectClassConfig
from pe_runtime.field.object_field import ObjectField
from pe_runtime.geometry.native_world import WORLD_FROM_NATIVE
from pe_runtime.interop.field_weights import STEP, annealing, convert_field, field_entries
from pe_runtime.rendering.release_2022 import release_2022
from pe_runtime.rendering.renderer import compose
from pe_runtime.rendering.scene import Rays, RenderSettings, SceneObject

CHANNELS = 5
FIELD = FieldConfig(
    width=8, depth=4, skip=2, octaves=3, base_frequency=0.5, head_width=8, branch_width=6,
    density="relu", density_scale=1.0,
)  # fmt: skip
BENDING = BendingConfig(width=8, depth=4, skip=2, octaves=2, base_frequency=0.5)
PLAYER = ObjectClassConfig(
    kind="playable", low=(-0.6, -1.2, 0.0), high=(0.6, 1.2, 2.1), samples=7,
    depth_range=(0.05, 30.0), style_features=4, pose_features=3, field=FIELD, bending=BENDING,
)  # fmt: skip
ARENA = ObjectClassConfig(
    low=(-10.0, -9.0, -0.6), high=(10.0, 8.0, 2.0), samples=5, depth_range=(0.05, 30.0),
    style_features=4, field=FIELD,
)  # fmt: skip
SKY = ObjectClassConfig(
    kind="sky", low=(-200.0, -200.0, -200.0), high=(200.0, 200.0, 200.0), samples=1, opaque=True,
    depth_range=(90.0, 91.0), sees_origin=True, style_features=4,
    field=replace(FIELD, base_frequency=1.0),
)  # fmt: skip


def seeded_entries(config, seed, step=60000):
    """A field's entries as a checkpoint of theirs would hold them, with random numbers."""
    generator = torch.Generator().manual_seed(seed)
    tensors = {}
    for name, shape in field_entries(config, CHANNELS).items():
        tensors[name] = 0.6 * torch.randn(shape, generator=generator, dtype=torch.float64)
        if name.endswith("running_var"):
            tensors[name] = tensors[name].abs() + 0.5
    if config.bending is not None:
        tensors[STEP] = torch.tensor(step)
    return tensors


def native(vector, up):
    return (WORLD_FROM_NATIVE[up].T @ torch.tensor(vector, dtype=torch.float64)).numpy()


def as_twin(config, tensors, codes, up, position=(0.0, 0.0, 0.0), heading=0.0):
    corners = np.stack([native(config.low, up), native(config.high, up)])
    bending = config.bending and (config.bending.depth, config.bending.skip, config.bending.octaves)
    return TwinObject(
        {name: tensor.double().numpy() for name, tensor in tensors.items()},
        tuple(corners.min(axis=0)),
        tuple(corners.max(axis=0)),
        config.samples,
        config.depth_range,
        codes[0].double().numpy(),
        codes[1].double().numpy(),
        config.field.depth,
        config.field.skip,
        config.field.octaves,
        bending,
        tuple(native(position, up)),
        (0.0, 0.0, heading) if up == "z" else (0.0, heading, 0.0),
        config.kind == "sky",
        config.kind == "playable",
    )


def as_ours(config, tensors, codes, up, position=(0.0, 0.0, 0.0), heading=0.0):
    field = ObjectField(config, CHANNELS)
    field.load_state_dict({n: t.float() for n, t in convert_field(tensors, config, up).items()})
    pose = codes[1][: config.pose_features]
    shown = torch.ones(1, dtype=torch.bool)
    turned = torch.tensor([heading]) if heading else None
    at = torch.tensor([position])
    return SceneObject(field, at, codes[0][None].float(), pose[None].float(), shown, turned)


def cast(up, seed, step=60000):
    """Two players in an arena under a sky, in both forms."""
    generator = torch.Generator().manual_seed(seed)
    places = [
        (ARENA, {}),
        (SKY, {}),
        (PLAYER, {"position": (0.5, -1.0, 0.0), "heading": 0.7}),
        (PLAYER, {"position": (0.2, 1.5, 0.0), "heading": -2.9}),
    ]
    twins, ours = [], []
    for index, (config, place) in enumerate(places):
        tensors = seeded_entries(config, seed + index, step)
        codes = [torch.randn(n, generator=generator) for n in (4, 3)]
        twins.append(as_twin(config, tensors, codes, up, **place))
        ours.append(as_ours(config, tensors, codes, up, **place))
    return twins, ours


def rays_from(origin, targets):
    directions = torch.tensor(targets, dtype=torch.float64) - torch.tensor(origin).double()
    depth = directions @ torch.tensor([0.1, 0.98, -0.15], dtype=torch.float64)
    centres = torch.tensor([origin], dtype=torch.float64)
    return Rays(centres, directions / depth[:, None], torch.zeros(len(targets), dtype=torch.long))


TARGETS = [
    (0.5, -1.0, 1.0), (0.3, -0.5, 0.4), (0.2, 1.5, 1.2), (0.45, 0.2, 0.9), (-3.0, 2.0, 0.0),
    (0.9, -1.3, 1.9), (4.0, 30.0, 18.0), (0.5, -1.0, 60.0), (0.1, 1.2, 0.2), (-0.1, 1.9, 2.05),
]  # fmt: skip


def settings_of(up, carve):
    config = ModelConfig(quadrature="release-2022", native_up=up, carve_overlaps=carve)
    return RenderSettings(near=0.05, release=release_2022(config), bucket=4)


@pytest.mark.parametrize("origin", [(1.0, -9.5, 3.1), (0.4, -3.0, 1.6), (0.7, -1.2, 1.0)])
@pytest.mark.parametrize("carve", [False, True])
@pytest.mark.parametrize("up", ["z", "y"])
def test_a_ray_through_imported_fields_gives_what_the_loops_give(up, carve, origin):
    twins, ours = cast(up, seed=7)
    rays = rays_from(origin, TARGETS)
    everything = (slice(0, len(TARGETS)), slice(0, CHANNELS))
    with torch.no_grad():
        composed = compose(rays, ours, [everything], settings_of(up, carve))
    for index, direction in enumerate(rays.directions):
        turned = native(direction.tolist(), up)
        seen, depth, opacity = along_ray(twins, native(origin, up), turned, CHANNELS, carve)
        sky = composed.weights[index, 1].item()
        assert composed.features[0][index].numpy() == pytest.approx(seen, abs=5e-5, rel=2e-5)
        assert composed.depth[index].item() + 90.0 * sky == pytest.approx(depth, abs=2e-3)
        assert composed.weights[index].sum().item() == pytest.approx(opacity, abs=1e-5)


def test_the_players_really_are_on_some_of_those_rays():
    _, ours = cast("z", seed=7)
    everything = (slice(0, len(TARGETS)), slice(0, CHANNELS))
    rays = rays_from((1.0, -9.5, 3.1), TARGETS)
    with torch.no_grad():
        shares = compose(rays, ours, [everything], settings_of("z", False)).weights
    assert (shares[:, 2:] > 0.05).any(dim=0).all()
    assert (shares[:, :2] > 0.05).any(dim=0).all()


def test_a_half_annealed_bending_is_imported_half_open():
    twins, ours = cast("z", seed=5, step=14000)
    rays = rays_from((1.0, -9.5, 3.1), TARGETS[:3])
    with torch.no_grad():
        composed = compose(rays, ours, [(slice(0, 3), slice(0, CHANNELS))], settings_of("z", False))
    for index, direction in enumerate(rays.directions):
        seen, _, _ = along_ray(twins, np.array([1.0, -9.5, 3.1]), direction.numpy(), CHANNELS)
        assert composed.features[0][index].numpy() == pytest.approx(seen, abs=5e-5, rel=2e-5)


def test_annealing_opens_octave_after_octave():
    assert annealing(0.0, 6).tolist() == [0.0] * 6
    assert annealing(60000.0, 6).tolist() == pytest.approx([1.0] * 6)
    assert annealing(25000.0, 6).tolist() == pytest.approx([1, 1, 0.5, 0, 0, 0], abs=1e-12)
    assert math.isclose(annealing(15000.0, 6)[1].item(), 0.5)


def test_a_field_asks_for_exactly_the_entries_of_the_published_players():
    field = FieldConfig(256, 8, 4, 10, 0.5, 256, 128, "relu", 1.0)
    bending = BendingConfig(128, 6, 3, 6, 0.5)
    config = replace(PLAYER, field=field, bending=bending, style_features=64, pose_features=32)
    entries = field_entries(config, 192)
    assert entries["nerf_model.backbone_layers.4.weight"] == (256, 319)
    assert entries["nerf_model.features_head.4.affine_transform.weight"] == (256, 64)
    assert entries["ray_bender.backbone_layers.3.weight"] == (128, 199)
    assert len(entries) == 46
