"""The authors' quadrature, one peculiarity after the other."""

import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from pe_runtime.config import FieldConfig, ModelConfig, ObjectClassConfig
from pe_runtime.contract.errors import ConfigError
from pe_runtime.field.object_field import ObjectField
from pe_runtime.geometry.boxes import intersect_box
from pe_runtime.rendering.compositing import composite
from pe_runtime.rendering.release_2022 import (
    LAST_GAP,
    OFFSET,
    Release2022,
    carve,
    place_samples,
    release_2022,
    thickness_to_next,
    within,
)
from pe_runtime.rendering.renderer import compose
from pe_runtime.rendering.scene import Rays, RenderSettings, SceneObject

LOW, HIGH = torch.tensor([-1.0, -1.0, 0.0]).double(), torch.tensor([1.0, 1.0, 2.0]).double()


def crossing(direction, offset=(OFFSET,) * 3):
    origin = torch.tensor([[-3.0, 0.2, 0.9]], dtype=torch.float64)
    direction = torch.tensor([direction], dtype=torch.float64)
    shift = torch.tensor(offset, dtype=torch.float64)
    near, far, hit = intersect_box(origin, direction, LOW, HIGH, -torch.inf, shift)
    return (origin + near[:, None] * direction)[0], (origin + far[:, None] * direction)[0], hit


def test_a_ray_along_a_positive_axis_loses_its_first_sample_and_keeps_its_last():
    first, last, hit = crossing((1.0, 0.01, 0.01))
    assert hit.item()
    assert not within(first, LOW, HIGH)
    assert within(last, LOW, HIGH)


def test_with_the_axis_turned_it_is_the_other_way_round():
    first, last, _ = crossing((1.0, 0.01, 0.01), offset=(-OFFSET, OFFSET, OFFSET))
    assert within(first, LOW, HIGH)
    assert not within(last, LOW, HIGH)


def test_the_offset_follows_the_native_axes():
    assert release_2022(ModelConfig()) is None
    tennis = release_2022(ModelConfig(quadrature="release-2022"))
    assert tennis == Release2022((OFFSET, OFFSET, OFFSET), False)
    minecraft = ModelConfig(quadrature="release-2022", native_up="y", carve_overlaps=True)
    assert release_2022(minecraft) == Release2022((OFFSET, -OFFSET, OFFSET), True)


def test_samples_include_both_ends_and_a_single_one_is_the_near_end():
    near, far = torch.tensor([2.0, 5.0]), torch.tensor([4.0, 5.0])
    assert place_samples(near, far, 3).tolist() == [[2.0, 3.0, 4.0], [5.0, 5.0, 5.0]]
    assert place_samples(near, far, 1).tolist() == [[2.0], [5.0]]
    assert place_samples(near[:0], far[:0], 3).shape == (0, 3)


@given(st.integers(2, 9), st.floats(0.0, 0.999), st.floats(0.1, 50.0))
def test_jittered_samples_stay_between_the_middles_to_their_neighbours(count, share, length):
    near, far = torch.tensor([[3.0], [3.0 + length]], dtype=torch.float64)
    even = place_samples(near, far, count)
    moved = place_samples(near, far, count, torch.full((1, count), share).double())
    step = length / (count - 1)
    assert (moved - even).abs().max() <= step / 2 + 1e-9
    assert (moved.diff() >= 0).all()
    assert 3.0 - 1e-9 <= moved.min() <= moved.max() <= 3.0 + length + 1e-9


def test_a_sample_extends_to_the_next_of_any_object_and_the_last_for_ever():
    depth = torch.tensor([[1.0, 3.0, 3.5]])
    density = torch.tensor([[0.5, 2.0, 1e-12]])
    assert thickness_to_next(depth, density)[0].tolist() == pytest.approx(
        [1.0, 1.0, 1e-12 * LAST_GAP], rel=1e-5
    )


def test_the_weights_of_five_samples_of_two_objects_written_out():
    # Object 1 at depths 1 and 3, object 2 at 2, 4 and 5; 4 is empty but ends the interval of 3.
    depth = torch.tensor([[1.0, 3.0, 2.0, 4.0, 5.0]], dtype=torch.float64)
    density = torch.tensor([[0.3, 0.7, 0.5, 0.0, 9.0]], dtype=torch.float64)
    light = torch.exp(-torch.tensor([0.0, 0.3, 0.8, 1.5], dtype=torch.float64))
    wanted = [(1 - light[1]), (light[2] - light[3]), (light[1] - light[2]), 0.0, light[3]]
    found = composite(depth, density, thickness_to_next)
    assert found[0].tolist() == pytest.approx([float(each) for each in wanted], abs=1e-12)


def test_a_player_carves_static_samples_up_to_the_sample_with_their_last_number():
    # Three static samples: the player's passage ends for them at its third of four samples.
    depth = torch.tensor([[1.0, 2.4, 4.0, 2.0, 2.5, 3.0, 5.0]])
    density = torch.ones_like(depth)
    moved, kept = carve(depth, density, [slice(0, 3)], [slice(3, 7)])
    assert moved.tolist() == [[1.0, 0.0, 4.0, 2.0, 2.5, 3.0, 5.0]]
    assert kept.tolist() == [[1.0, 0.0, 1.0, 1.0, 1.0, 1.0, 1.0]]


def test_a_sky_of_one_sample_and_a_missed_player_carve_nothing():
    depth = torch.tensor([[90.0, 2.0, 3.0], [90.0, 0.05, 0.05]])
    density = torch.ones_like(depth)
    moved, kept = carve(depth, density, [slice(0, 1)], [slice(1, 3)])
    assert torch.equal(moved, depth)
    assert torch.equal(kept, density)


def fog(kind="static", **settings):
    config = ObjectClassConfig(
        kind=kind, low=(-1.0, -1.0, 0.0), high=(1.0, 1.0, 2.0), samples=6, style_features=2,
        field=FieldConfig(width=4, depth=2, density="relu", density_scale=1.0), **settings,
    )  # fmt: skip
    torch.manual_seed(1)
    field = ObjectField(config, 3)
    torch.nn.init.ones_(field.density.bias)
    return field


def seen(field, visible=True, y=0.0):
    centres = torch.tensor([[0.0, -8.0, 1.0]], dtype=torch.float64)
    directions = torch.tensor([[0.0, 1.0, 0.0], [0.1, 1.0, 0.05]], dtype=torch.float64)
    rays = Rays(centres, directions, torch.zeros(2, dtype=torch.long))
    shown = torch.tensor([visible])
    place = torch.tensor([[0.0, y, 0.0]])
    one = SceneObject(field, place, torch.zeros(1, 2), torch.zeros(1, 0), shown)
    release = Release2022((OFFSET,) * 3, False)
    with torch.no_grad():
        return compose(rays, [one], [(slice(0, 2), slice(0, 3))], RenderSettings(release=release))


def test_an_object_beyond_or_before_its_depth_range_is_not_there():
    assert (seen(fog()).weights > 0.1).all()
    assert (seen(fog(depth_range=(0.05, 3.0))).weights == 0).all()
    assert (seen(fog(depth_range=(20.0, 30.0))).weights == 0).all()
    assert (seen(fog(), y=-30.0).weights == 0).all()


def test_a_hidden_object_gives_zeros_and_no_samples():
    found = seen(fog(), visible=False)
    assert (found.features[0] == 0).all()
    assert found.statistics["samples"] == 0


def test_opaque_classes_have_no_place_in_this_quadrature():
    wall = ObjectClassConfig(opaque=True)
    with pytest.raises(ConfigError, match="no opaque class"):
        ModelConfig(quadrature="release-2022", classes={"wall": wall})


def test_a_sample_that_extends_over_nothing_is_nothing_however_dense():
    density = torch.tensor([[torch.inf, torch.inf, 2.0]], requires_grad=True)
    thickness = thickness_to_next(torch.tensor([[1.0, 1.0, 1.5]]), density)
    assert thickness[0, 0] == 0.0 and thickness[0, 1] > 1e30
    (slope,) = torch.autograd.grad(thickness[:, 0].sum() + thickness[:, 2].sum(), density)
    assert torch.isfinite(slope).all()
