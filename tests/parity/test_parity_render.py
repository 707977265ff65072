"""Recorded frames of the authors' release, through import, environment and renderer."""

import pytest
import torch
from interop.official_weights import environment_weights, save_stage
from parity.parity_files import check_within, parity_case

from pe_runtime.environment import PlayableEnvironment, RenderOptions
from pe_runtime.frame_renderer import FrameRenderer
from pe_runtime.geometry.cameras import Cameras
from pe_runtime.interop.conventions import (
    FOCAL_MULTIPLIERS,
    camera_from_theirs,
    focal_from_theirs,
    positions_from_theirs,
)
from pe_runtime.interop.official_checkpoint import import_official
from pe_runtime.rendering.frame_composition import compose_measures
from pe_runtime.rendering.scene import RenderSettings
from pe_runtime.state import EnvironmentState, ObjectState

SKY_DEPTH = 90.0


@pytest.fixture(scope="module", params=["tennis", "minecraft"])
def case(request):
    return parity_case(f"{request.param}_render")


@pytest.fixture(scope="module")
def environment(case, tmp_path_factory):
    folder = tmp_path_factory.mktemp("imported")
    known = {
        n: t.float() if t.is_floating_point() else t for n, t in case["state_dict_fp16"].items()
    }
    weights = environment_weights(case["which"], known)
    save_stage(folder / "stage_2.pth.tar", weights)
    report = import_official([folder / "stage_2.pth.tar"], folder / "model.safetensors")
    assert report.world == case["which"]
    return PlayableEnvironment.load(folder / "model.safetensors", "cpu")


@pytest.fixture(scope="module")
def camera(case, environment):
    inputs, (height, width) = case["inputs"], case["image_size"]
    focal = focal_from_theirs(inputs["focals"].item(), FOCAL_MULTIPLIERS[case["which"]])
    angles, place = inputs["camera_rotations"].flatten(), inputs["camera_translations"].flatten()
    up = environment.config.native_up
    return camera_from_theirs(angles.numpy(), place.numpy(), focal, (width, height), up)


@pytest.fixture(scope="module")
def state(case, environment):
    inputs, up = case["inputs"], environment.config.native_up
    objects = {}
    for index, each in enumerate(environment.config.objects):
        config = environment.config.class_of(each.name)
        theirs = inputs["object_translation_parameters"][0, 0, :, index].numpy()
        at = torch.from_numpy(positions_from_theirs(theirs, up)).float()
        angles = inputs["object_rotation_parameters"][0, 0, :, index]
        style = inputs["object_style"][0, 0, :, index]
        pose = inputs["object_deformation"][0, 0, : config.pose_features, index]
        shown = bool(inputs["object_in_scene"][0, 0, index])
        heading = angles[{"y": 1, "z": 2}[up]].item()
        objects[each.name] = ObjectState(at, style, pose, shown, heading)
    return EnvironmentState(objects)


def test_the_picture_is_the_recorded_one(case, environment, camera, state):
    frame = environment.render(state, camera, RenderOptions())
    apart = torch.from_numpy(frame.rgb).permute(2, 0, 1) - case["image"]
    check_within(f"{case['which']} picture", apart.abs().max().item(), 5e-5)


def test_feature_maps_opacity_and_depth_are_the_recorded_ones(case, environment, camera, state):
    networks, size = environment.networks, tuple(case["image_size"])
    codes = environment.codes(state)
    settings = RenderSettings(near=environment.config.near)
    view, names = Cameras.stack([camera]), networks.drawn(codes)
    drawn = FrameRenderer(networks).features(view, codes, settings)
    passages = [drawn.kept.passages[name] for name in names]
    levels, start = [], 0
    for each in drawn.maps:
        which = torch.arange(start, start + len(each))
        levels.append(compose_measures(passages, which, networks.complete(settings)))
        start += len(each)
    for index, (stride, found) in enumerate(zip((4, 8), levels, strict=True)):
        cells, what = (size[0] // stride, size[1] // stride), f"{case['which']} at stride {stride}"
        features = drawn.maps[index].T.unflatten(1, cells)
        apart = features - case["decoder_inputs"][index].float()
        check_within(f"{what}, features", apart.abs().max().item(), 3e-3)
        depth = found.depth
        if "sky" in names:
            # Theirs sums w t over everything; ours leaves the sky out.
            depth = depth + SKY_DEPTH * found.shares[:, names.index("sky")]
        apart = (depth.reshape(cells) - case["depth"][index]).abs()
        seen = case["opacity"][index] > 0.01
        check_within(f"{what}, depth in metres", apart[seen].max().item(), 1e-3)
        opacity = found.shares.sum(dim=1).reshape(cells)
        apart = opacity - case["opacity"][index]
        check_within(f"{what}, opacity", apart.abs().max().item(), 1e-4)
