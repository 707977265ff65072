"""Single frames: the same as the slow composition, whatever was drawn before, and no work twice."""

from dataclasses import replace

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from small_world import HEIGHT, WIDTH, camera, random_codes, small_config, small_networks
from training.test_release_training import release_config

from pe_runtime import frame_renderer
from pe_runtime.frame_renderer import FrameRenderer, base_depth
from pe_runtime.geometry.cameras import Cameras, ray_directions
from pe_runtime.networks import SynthesisNetworks
from pe_runtime.rendering import frame_drawing
from pe_runtime.rendering.renderer import compose
from pe_runtime.rendering.sampling import grid_pixels
from pe_runtime.rendering.scene import Rays, RenderSettings

KEEPING = RenderSettings(remember=True)
NAMES = ("player_1", "player_2")


@pytest.fixture(scope="module", autouse=True)
def without_gradients():
    with torch.no_grad():
        yield


def released_networks():
    torch.manual_seed(0)
    networks = SynthesisNetworks(release_config()).eval()
    for field in networks.fields.values():
        if field.density is not None:
            torch.nn.init.ones_(field.density.bias)
    return networks


@pytest.fixture(scope="module", params=["interval", "release-2022"])
def networks(request):
    return small_networks() if request.param == "interval" else released_networks()


def codes_of(networks, seed=0, **places):
    codes = random_codes(networks.config, seed=seed, **places)
    if networks.config.quadrature == "interval":
        return codes
    headings = {name: torch.tensor([0.3 + i]) for i, name in enumerate(NAMES)}
    return {n: replace(each, heading=headings.get(n)) for n, each in codes.items()}


def view(azimuth=0.2, **more):
    return Cameras.stack([camera(azimuth, **more)])


def slow(networks, cameras, codes, asked):
    """Features, shares and depth by the composition that training uses."""
    asked = networks.complete(replace(asked, remember=False))
    size, levels = FrameRenderer(networks).map_size(cameras), []
    strides = networks.config.feature_renderer.strides
    for stride, channels in zip(strides, networks.channels(), strict=True):
        pixels = grid_pixels(0, 0, *size, stride)
        frame = torch.zeros(len(pixels), dtype=torch.long)
        directions = ray_directions(cameras, frame, pixels, networks.ray_dtype)
        rays = Rays(cameras.centres, directions, frame)
        everything = (slice(0, len(pixels)), channels)
        levels.append(compose(rays, networks.scene(codes), [everything], asked).features[0])
    return levels


def test_a_frame_is_what_the_slow_composition_gives(networks):
    codes = codes_of(networks)
    found = FrameRenderer(networks).features(view(), codes, KEEPING)
    for mine, wanted in zip(found.maps, slow(networks, view(), codes, KEEPING), strict=True):
        torch.testing.assert_close(mine, wanted, atol=2e-5, rtol=1e-5)
    assert found.changed is None
    assert found.statistics["composed_rays"] == found.statistics["rays"]


def test_depth_and_masks_are_those_of_the_slow_composition(networks):
    codes = codes_of(networks)
    seen = FrameRenderer(networks).geometry(view(), codes, RenderSettings())
    pixels = grid_pixels(0, 0, HEIGHT, WIDTH, 1)
    frame = torch.zeros(len(pixels), dtype=torch.long)
    directions = ray_directions(view(), frame, pixels, networks.ray_dtype)
    rays = Rays(view().centres, directions, frame)
    asked = networks.complete(RenderSettings())
    wanted = compose(rays, networks.scene(codes), [], asked)
    for index, mask in enumerate(seen.masks.values()):
        torch.testing.assert_close(mask.flatten(), wanted.weights[:, index], atol=1e-5, rtol=0)
    solid = torch.isfinite(seen.depth.flatten())
    depth = (wanted.depth / wanted.solid.clamp(min=1e-6))[solid]
    torch.testing.assert_close(seen.depth.flatten()[solid], depth, atol=1e-3, rtol=1e-4)


CHANGES = st.lists(
    st.tuples(
        st.sampled_from(["move", "pose", "style", "hide", "show", "turn", "camera", "nothing"]),
        st.sampled_from(NAMES),
        st.floats(-0.5, 0.5),
    ),
    min_size=1,
    max_size=4,
)


def changed(codes, azimuth, change):
    what, name, by = change
    own = codes[name]
    if what == "camera":
        return codes, azimuth + by
    own = {
        "move": lambda: replace(own, position=own.position + torch.tensor([by, -by, 0.0])),
        "pose": lambda: replace(own, pose=own.pose + by),
        "style": lambda: replace(own, style=own.style * (1 + by)),
        "hide": lambda: replace(own, visible=torch.tensor([False])),
        "show": lambda: replace(own, visible=torch.tensor([True])),
        "turn": lambda: replace(own, heading=torch.tensor([by])),
        "nothing": lambda: own,
    }[what]()
    return {**codes, name: own}, azimuth


@pytest.mark.parametrize("kind", ["interval", "release-2022"])
@given(changes=CHANGES)
@settings(max_examples=25)
def test_whatever_came_before_a_frame_has_the_bits_of_a_fresh_one(kind, changes):
    networks = NETWORKS[kind]
    renderer, codes, azimuth = FrameRenderer(networks), codes_of(networks), 0.2
    renderer.draw(view(azimuth), codes, KEEPING)
    for change in changes:
        codes, azimuth = changed(codes, azimuth, change)
        picture, _ = renderer.draw(view(azimuth), codes, KEEPING)
        fresh, _ = FrameRenderer(networks).draw(view(azimuth), codes, KEEPING)
        assert torch.equal(picture, fresh)


NETWORKS = {"interval": small_networks(), "release-2022": released_networks()}


def test_a_frame_that_equals_the_last_costs_no_ray(networks):
    renderer, codes = FrameRenderer(networks), codes_of(networks)
    first, _ = renderer.draw(view(), codes, KEEPING)
    again, counted = renderer.draw(view(), codes, KEEPING)
    assert torch.equal(first, again)
    assert counted["composed_rays"] == counted["field_samples"] == 0
    assert counted["feature_samples"] == counted["hits"] == 0
    assert counted["kept_objects"] == len(codes)


def test_only_what_moves_is_sampled_again(networks):
    renderer, codes = FrameRenderer(networks), codes_of(networks)
    _, before = renderer.draw(view(), codes, KEEPING)
    own = codes["player_1"]
    moved = {**codes, "player_1": replace(own, position=own.position + 0.1)}
    _, counted = renderer.draw(view(), moved, KEEPING)
    assert counted["kept_objects"] == len(codes) - 1
    assert 0 < counted["composed_rays"] < before["composed_rays"]
    assert 0 < counted["field_samples"] < before["field_samples"]


def test_another_camera_or_other_settings_begin_anew(networks):
    renderer, codes = FrameRenderer(networks), codes_of(networks)
    renderer.draw(view(), codes, KEEPING)
    for cameras, asked in ((view(0.3), KEEPING), (view(0.3), replace(KEEPING, near=0.06))):
        _, counted = renderer.draw(cameras, codes, asked)
        assert counted["kept_objects"] == 0
        assert counted["composed_rays"] == counted["rays"]


def test_what_is_kept_can_be_given_back(networks):
    renderer, codes = FrameRenderer(networks), codes_of(networks)
    renderer.draw(view(), codes, KEEPING)
    renderer.forget()
    _, counted = renderer.draw(view(), codes, KEEPING)
    assert counted["kept_objects"] == 0


def test_hidden_players_cost_what_the_static_scene_costs(networks):
    codes = codes_of(networks)
    hidden = {n: replace(c, visible=torch.tensor([n not in NAMES])) for n, c in codes.items()}
    static = {n: c for n, c in codes.items() if n not in NAMES}
    pictures, counts = zip(
        *(FrameRenderer(networks).draw(view(), each, KEEPING) for each in (hidden, static)),
        strict=True,
    )
    assert torch.equal(*pictures)
    assert counts[0] == counts[1]


def test_ten_players_out_of_view_cost_no_sample():
    config = small_config(players=12)
    networks = small_networks(config)
    far = [(40.0 + i, 3.0, 0.0) for i in range(10)]
    codes = random_codes(config, places=[(-0.7, 0.1, 0.0), (0.8, -0.2, 0.0), *far])
    near = {n: c for n, c in codes.items() if n not in [f"player_{i}" for i in range(3, 13)]}
    pictures, counts = zip(
        *(FrameRenderer(networks).draw(view(), each, KEEPING) for each in (codes, near)),
        strict=True,
    )
    assert torch.equal(*pictures)
    for key in ("hits", "field_samples", "feature_samples"):
        assert counts[0][key] == counts[1][key]


@pytest.mark.parametrize("threshold", [1e-4, 1e-2])
def test_a_weight_threshold_loses_no_more_than_the_light_below_it(networks, threshold):
    codes = codes_of(networks)
    exact = FrameRenderer(networks).features(view(), codes, KEEPING)
    asked = replace(KEEPING, weight_threshold=threshold)
    found = FrameRenderer(networks).features(view(), codes, asked)
    assert found.statistics["feature_samples"] <= exact.statistics["feature_samples"]
    samples = sum(c.samples for c in networks.config.classes.values()) * 2
    for mine, wanted in zip(found.maps, exact.maps, strict=True):
        bound = threshold * samples * (wanted.abs().max() + 50)
        assert (mine - wanted).abs().max() <= bound


def test_occupancy_leaves_out_empty_space_and_nothing_that_is_seen(networks):
    codes = codes_of(networks)
    asked = replace(KEEPING, occupancy=True)
    exact = FrameRenderer(networks).features(view(), codes, KEEPING)
    found = FrameRenderer(networks).features(view(), codes, asked)
    # Fog everywhere: a coarse look finds it everywhere, or is not worth its cost.
    for mine, wanted in zip(found.maps, exact.maps, strict=True):
        assert (mine - wanted).abs().max() < 0.2 * wanted.abs().max()


def test_bfloat16_is_near_float32(networks):
    codes = codes_of(networks)
    exact, _ = FrameRenderer(networks).draw(view(), codes, KEEPING)
    found, _ = FrameRenderer(networks).draw(view(), codes, replace(KEEPING, bfloat16=True))
    assert found.dtype == torch.float32
    assert (found - exact).abs().max() < 0.05


def test_no_objects_and_minimal_pictures_are_drawn_too(networks):
    for cameras in (view(), view(width=1, rows=1), view(width=3, rows=2)):
        picture, counted = FrameRenderer(networks).draw(cameras, {}, KEEPING)
        assert picture.shape == (3, cameras.height, cameras.width)
        assert torch.isfinite(picture).all()
        assert counted["field_samples"] == 0
        seen = FrameRenderer(networks).geometry(cameras, {}, KEEPING)
        assert torch.isinf(seen.depth).all()
        assert seen.masks == {}


def test_far_objects_are_drawn_from_their_differences_in_depth():
    networks = NETWORKS["interval"]
    codes = {n: c for n, c in codes_of(networks).items() if n in NAMES}
    near, far = view(), view()
    pose = far.world_from_camera.clone()
    pose[0, :3, 3] -= 3e5 * pose[0, :3, 2]
    intrinsics = far.intrinsics.clone()
    # A lens that brings the players back to the size that they had.
    distance = 5.0
    intrinsics[:, :2, :2] *= (3e5 + distance) / distance
    far = replace(far, world_from_camera=pose, intrinsics=intrinsics)
    renderer = FrameRenderer(networks)
    placed = renderer._placed(codes, KEEPING)
    assert base_depth(near, placed, KEEPING) == 0.0
    assert 2.99e5 < base_depth(far, placed, KEEPING) < 3e5 + 5
    found = renderer.features(far, codes, KEEPING)
    depths = [each.depth for each in found.kept.passages.values()]
    assert max(each.max().item() for each in depths) < 1e3
    assert (found.kept.passages["player_1"].depth.diff(dim=1) > 0).all()
    seen = renderer.geometry(far, codes, KEEPING)
    solid = torch.isfinite(seen.depth)
    assert ((seen.depth[solid] - 3e5 - distance).abs() < 3.0).all()


def test_features_asked_for_between_two_frames_spoil_no_picture(networks):
    codes = codes_of(networks)
    own = codes["player_1"]
    moved = {**codes, "player_1": replace(own, position=own.position + 0.1)}
    renderer = FrameRenderer(networks)
    renderer.draw(view(), codes, KEEPING)
    renderer.features(view(), moved, KEEPING)
    picture, _ = renderer.draw(view(), moved, KEEPING)
    assert torch.equal(picture, FrameRenderer(networks).draw(view(), moved, KEEPING)[0])


@pytest.mark.parametrize("where", ["compose_features", "decode_again"])
def test_a_frame_that_is_interrupted_spoils_no_later_one(networks, where, monkeypatch):
    codes = codes_of(networks)
    own = codes["player_1"]
    moved = {**codes, "player_1": replace(own, position=own.position + 0.1)}
    renderer = FrameRenderer(networks)
    renderer.draw(view(), codes, KEEPING)
    home = frame_drawing if where == "compose_features" else frame_renderer
    working = getattr(home, where)

    def interrupted(*args):
        if where == "decode_again":
            working(*args)  # has written over what it was given
        raise KeyboardInterrupt

    monkeypatch.setattr(home, where, interrupted)
    with pytest.raises(KeyboardInterrupt):
        renderer.draw(view(), moved, KEEPING)
    monkeypatch.undo()
    for each in (moved, codes):
        picture, _ = renderer.draw(view(), each, KEEPING)
        assert torch.equal(picture, FrameRenderer(networks).draw(view(), each, KEEPING)[0])
