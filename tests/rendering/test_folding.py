"""Style and pose folded into weights: the numbers of V and B themselves, and nothing done twice."""

from dataclasses import replace

import pytest
import torch
from small_world import random_codes, shake, small_config
from training.test_release_training import release_config

from pe_runtime.networks import SynthesisNetworks
from pe_runtime.rendering import folding
from pe_runtime.rendering.folding import FieldFolder


def networks_of(config):
    torch.manual_seed(0)
    networks = SynthesisNetworks(config).eval()
    shake(networks, 0.05)
    return networks


@pytest.fixture(params=["interval", "release-2022"])
def networks(request):
    config = small_config() if request.param == "interval" else release_config()
    return networks_of(config)


@pytest.fixture(autouse=True)
def without_gradients():
    with torch.no_grad():
        yield


def points(field, count=300, seed=1):
    columns = max(3, max(field.entering) + 1)
    generator = torch.Generator().manual_seed(seed)
    return torch.rand(count, columns, generator=generator) * 2 - 1


def objects(networks):
    codes = random_codes(networks.config, seed=3)
    for each in networks.config.objects:
        yield networks.fields[each.class_name], codes[each.name]


@pytest.mark.parametrize("count", [0, 1, 300, 1025])
def test_a_folded_field_gives_what_v_and_b_give(networks, count):
    for field, codes in objects(networks):
        rows, frame = points(field, count), torch.zeros(count, dtype=torch.long)
        folded = FieldFolder(field).fold(codes.style[0], codes.pose[0])
        hidden = folded.hidden(rows)
        wanted = field.trunk(rows[:, None], frame, codes.pose)
        torch.testing.assert_close(hidden, wanted[:, 0], atol=1e-5, rtol=1e-5)
        branch = folded.branch(hidden)
        wanted = field.branch(wanted, frame, codes.style)[:, 0]
        torch.testing.assert_close(branch, wanted, atol=1e-5, rtol=1e-5)
        share = torch.rand(count)
        for channels in networks.channels():
            found = folded.last_layer(branch, share, channels)
            wanted = field.features(branch, share, channels)
            torch.testing.assert_close(found, wanted, atol=1e-5, rtol=1e-5)


def test_a_row_is_the_same_in_any_company_and_with_any_number_of_threads(networks):
    before = torch.get_num_threads()
    for field, codes in objects(networks):
        folded, rows = FieldFolder(field).fold(codes.style[0], codes.pose[0]), points(field, 2500)
        found = []
        try:
            for threads, some in ((1, rows), (2, rows), (3, rows), (2, rows.flip(0))):
                torch.set_num_threads(threads)
                branch = folded.branch(folded.hidden(some))
                drawn = folded.last_layer(branch, torch.ones(2500), networks.channels()[0])
                found.append(drawn if some is rows else drawn.flip(0))
        finally:
            torch.set_num_threads(before)
        for other in found[1:]:
            assert torch.equal(found[0], other)


def test_a_new_pose_packs_no_weight_again(networks, monkeypatch):
    field, codes = next(o for o in objects(networks) if o[0].bending is not None)
    folder = FieldFolder(field)
    first = folder.fold(codes.style[0], codes.pose[0])
    fresh = FieldFolder(field).fold(codes.style[0], codes.pose[0] + 1)
    monkeypatch.delattr(folding, "affine")
    second = folder.fold(codes.style[0], codes.pose[0] + 1, like=first)
    rows = points(field)
    assert torch.equal(second.hidden(rows), fresh.hidden(rows))
    assert not torch.equal(second.hidden(rows), first.hidden(rows))
    assert second.head is first.head


def test_a_new_style_is_folded_anew(networks):
    for field, codes in objects(networks):
        folder = FieldFolder(field)
        one = folder.fold(codes.style[0], codes.pose[0])
        other = folder.fold(codes.style[0] + 1, codes.pose[0])
        hidden = one.hidden(points(field))
        assert not torch.equal(one.branch(hidden), other.branch(hidden))


def test_bfloat16_is_near_float32_and_gives_float32_where_sums_begin(networks):
    for field, codes in objects(networks):
        rows = points(field)
        exact = FieldFolder(field).fold(codes.style[0], codes.pose[0])
        rough = FieldFolder(field, torch.bfloat16).fold(codes.style[0], codes.pose[0])
        mine, wanted = rough.branch(rough.hidden(rows)), exact.branch(exact.hidden(rows))
        assert mine.dtype == torch.float32
        assert (mine - wanted).abs().max() < 0.1 * (1 + wanted.abs().max())


def test_without_packed_products_the_numbers_are_the_same_to_rounding(networks):
    for field, codes in objects(networks):
        rows, folded = points(field), FieldFolder(field).fold(codes.style[0], codes.pose[0])
        plain = replace(
            folded,
            trunk=replace(
                folded.trunk, layers=tuple(replace(x, packed=None) for x in folded.trunk.layers)
            ),
        )
        torch.testing.assert_close(plain.hidden(rows), folded.hidden(rows), atol=1e-5, rtol=1e-5)
