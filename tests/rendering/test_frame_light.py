"""Light along the rays of a frame: what composing every sample gives, in float64."""

import math

import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from small_world import small_networks

from pe_runtime.rendering.compositing import OPAQUE
from pe_runtime.rendering.folding import FieldFolder
from pe_runtime.rendering.frame_composition import Level, compose_features, compose_measures
from pe_runtime.rendering.frame_light import light
from pe_runtime.rendering.frame_passages import FrameObject, FramePassage
from pe_runtime.rendering.passages import SKY_DEPTH
from pe_runtime.rendering.scene import RenderSettings

NETWORKS = small_networks()
RAYS = 12


def folded(class_name):
    field = NETWORKS.fields[class_name]
    with torch.no_grad():
        style, pose = (
            torch.zeros(field.config.style_features),
            torch.zeros(field.config.pose_features),
        )
        return FieldFolder(field).fold(style, pose)


FIELDS = {name: folded(name) for name in ("ground", "player")}


def passage(kind, samples):
    """An object's samples, from a list of depths and thicknesses for each ray; None is a miss."""
    field = FIELDS[kind]
    rays = torch.tensor([i for i, own in enumerate(samples) if own is not None], dtype=torch.long)
    row_of = torch.full((len(samples),), -1)
    row_of[rays] = torch.arange(len(rays))
    found = [own for own in samples if own is not None]
    count = len(found[0]) if found else 2
    table = torch.tensor(found, dtype=torch.float32).reshape(len(rays), count, 2)
    hidden = None
    if kind == "player":
        hidden = torch.zeros(len(rays) * count, field.trunk.layers[-1].bias.shape[0])
    return FramePassage(
        FrameObject(field, torch.zeros(3)),
        rays,
        row_of,
        table[..., 0].contiguous(),
        table[..., 1].contiguous(),
        torch.arange(len(rays) * count).reshape(len(rays), count),
        torch.zeros(len(rays) * count, 3),
        hidden,
        2 * SKY_DEPTH,
    )


def one_by_one(objects, ray):
    """Weight of every sample of every object on a ray, from the equation."""
    samples = [
        (float(depth), float(thickness), owner, number)
        for owner, own in enumerate(objects)
        if own[ray] is not None
        for number, (depth, thickness) in enumerate(own[ray])
    ]
    weights, left = {}, 1.0
    for _, thickness, owner, number in sorted(samples, key=lambda sample: sample[0]):
        weights[owner, number] = left * -math.expm1(-thickness)
        left *= math.exp(-thickness)
    return weights


DEPTHS = st.integers(1, 30).map(lambda n: n / 2)
SURFACE = st.lists(st.none() | DEPTHS.map(lambda d: [(d, OPAQUE)]), min_size=RAYS, max_size=RAYS)
# A quarter off, so that no volume's sample lies right in a surface.
VOLUME = st.lists(
    st.none()
    | st.lists(
        st.tuples(DEPTHS.map(lambda d: d + 0.25), st.floats(0, 3) | st.just(1e9)),
        min_size=3,
        max_size=3,
    ).map(sorted),
    min_size=RAYS,
    max_size=RAYS,
)


@given(st.lists(SURFACE, max_size=3), st.lists(VOLUME, max_size=2))
def test_weights_are_those_of_the_equation_over_all_samples(surfaces, volumes):
    objects = [*surfaces, *volumes]
    kinds = ["ground"] * len(surfaces) + ["player"] * len(volumes)
    passages = [passage(*each) for each in zip(kinds, objects, strict=True)]
    which = torch.arange(RAYS)
    found = light(passages, which, RenderSettings())
    assert [each.passage for each in found] == passages
    mine = {}
    for owner, lit in enumerate(found):
        for ray, row, weight in zip(lit.met.tolist(), lit.row.tolist(), lit.weight, strict=True):
            assert passages[owner].rays[row] == ray
            for number, value in enumerate(weight.tolist()):
                mine[ray, owner, number] = value
    for ray in range(RAYS):
        for (owner, number), wanted in one_by_one(objects, ray).items():
            assert mine.pop((ray, owner, number), 0.0) == pytest.approx(wanted, abs=1e-6)
    assert not mine


@given(st.lists(SURFACE, min_size=1, max_size=3), st.lists(VOLUME, max_size=1))
def test_a_ray_has_the_same_bits_in_any_company(surfaces, volumes):
    passages = [passage("ground", own) for own in surfaces]
    passages += [passage("player", own) for own in volumes]
    whole = compose_measures(passages, torch.arange(RAYS), RenderSettings())
    for ray in range(0, RAYS, 5):
        alone = compose_measures(passages, torch.tensor([ray]), RenderSettings())
        assert torch.equal(alone.shares[0], whole.shares[ray])
        assert torch.equal(alone.depth[0], whole.depth[ray])


def test_of_surfaces_at_equal_depths_the_first_in_the_model_is_seen():
    one, other = ([[(2.0, OPAQUE)]] * RAYS for _ in range(2))
    seen = compose_measures(
        [passage("ground", one), passage("ground", other)], torch.arange(RAYS), RenderSettings()
    )
    assert seen.shares.tolist() == [[1.0, 0.0]] * RAYS


def test_features_are_asked_for_where_a_surface_is_seen_and_nowhere_else():
    near = [[(1.0, OPAQUE)] if ray < 3 else None for ray in range(RAYS)]
    far = [[(2.0, OPAQUE)]] * RAYS
    wall = [[(0.5, 1e9), (0.6, 0.0), (0.7, 0.0)] if ray < 5 else None for ray in range(RAYS)]
    passages = [passage("ground", near), passage("ground", far), passage("player", wall)]
    levels = [Level(slice(0, RAYS), NETWORKS.channels()[0])]
    seen = compose_features(passages, torch.arange(RAYS), levels, RenderSettings())
    # Five rays end in the wall's first sample, no ray in the near surface, the others in the far.
    assert seen.evaluated == 5 + (RAYS - 5)
    assert compose_features(passages[:2], torch.arange(RAYS), levels, RenderSettings()).evaluated


def test_no_rays_and_no_objects_give_nothing():
    levels = [Level(slice(0, 0), NETWORKS.channels()[0])]
    for passages in ([], [passage("ground", [[(1.0, OPAQUE)]] * RAYS)]):
        nobody = torch.zeros(0, dtype=torch.long)
        assert compose_features(passages, nobody, levels, RenderSettings()).evaluated == 0
        assert compose_measures(passages, nobody, RenderSettings()).shares.shape == (
            0,
            len(passages),
        )
