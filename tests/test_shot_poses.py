"""Held poses, regions and layers of shots: in states, in digests, in files."""

import dataclasses

import numpy as np
import OpenImageIO as oiio  # noqa: N813 its own documentation's name
import pytest
from test_shots import LineWorld, camera, make_shot, start, state  # noqa: F401 -- a fixture

from pe_runtime.contract.errors import ShotError
from pe_runtime.contract.shot import ObjectTrack, PoseKey, StyleMix
from pe_runtime.kept_frames import Frame
from pe_runtime.shots import frame_state, prepare_shot, render_shot
from pe_runtime.shots.files import write_frame
from pe_runtime.shots.frames import frame_digest, render_options
from pe_runtime.shots.rollout import prepared_from, rollout_key

WALKS = ((1, 2),)


def held(*keys, **more):
    return ObjectTrack("player_1", WALKS, poses=tuple(PoseKey(*key) for key in keys), **more)


def poses_of(prepared, name="player_1"):
    return [float(frame_state(prepared, n)[name].pose) for n in prepared.shot.frames]


def test_a_pose_is_that_of_another_frame_while_it_is_held(start):  # noqa: F811
    free = poses_of(
        prepare_shot(LineWorld(), make_shot(start, frames=7, fps=5.0, objects=(held(),)))
    )
    assert free == [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0]
    track = held((2, 5), (4, 1), (6, None))
    shot = make_shot(start, frames=7, fps=5.0, objects=(track,))
    prepared = prepare_shot(LineWorld(), shot)
    assert poses_of(prepared) == [0.0, 4.0, 4.0, 0.0, 0.0, 5.0, 6.0]
    walked = [float(frame_state(prepared, n)["player_1"].position[0]) for n in shot.frames]
    assert walked == sorted(walked) and walked[-1] > 3.0


def test_a_take_holds_the_pose_of_a_frame_outside_of_it(start):  # noqa: F811
    whole = make_shot(start, frames=7, fps=5.0, objects=(held(),))
    predicted = prepare_shot(LineWorld(), whole).rollout
    own = held((1, 6), styles=(StyleMix(3, None, "player_2", 1.0),))
    take = dataclasses.replace(
        whole, frame_start=3, frame_end=3, cameras=(camera(),), objects=(own,)
    )
    taken = frame_state(prepared_from(take, predicted, {}), 3)["player_1"]
    assert float(taken.pose) == 5.0
    np.testing.assert_array_equal(taken.style, predicted.at(1)["player_2"].style)


@pytest.mark.parametrize("frame", [0, 8, 1000])
def test_a_pose_of_a_frame_that_is_not_predicted_is_refused(start, frame):  # noqa: F811
    shot = make_shot(start, frames=7, objects=(held((2, frame)),))
    with pytest.raises(ShotError, match=f"'player_1' holds the pose of frame {frame}.*1 to 7"):
        prepare_shot(LineWorld(), shot)


def test_poses_and_regions_decide_pixels_but_no_rollout(start):  # noqa: F811
    plain = make_shot(start, frames=7, fps=5.0, objects=(held(),))
    posed = dataclasses.replace(plain, objects=(held((4, 1)),))
    part = dataclasses.replace(plain, region=(0, 0, 4, 4))
    assert rollout_key(plain) == rollout_key(posed) == rollout_key(part)
    digests = [
        [frame_digest("m", prepare_shot(LineWorld(), shot), n) for n in shot.frames]
        for shot in (plain, posed, part)
    ]
    assert [a == b for a, b in zip(digests[0], digests[1], strict=True)] == [True] * 3 + [False] * 4
    assert not set(digests[0]) & set(digests[2])


def test_what_a_shot_asks_for_reaches_the_environment(start):  # noqa: F811
    passes = ("layer:player_2", "background", "mask:player_1")
    options = render_options(make_shot(start, passes=passes, region=(1, 2, 3, 4)))
    assert options.layers == ("player_2",) and options.background and not options.depth
    assert options.masks == ("player_1",) and options.region == (1, 2, 3, 4)


@pytest.mark.parametrize("name", ["layer:player_3", "layer:ground"])
def test_a_layer_of_what_is_no_playable_object_is_refused(start, name):  # noqa: F811
    with pytest.raises(ShotError, match=name.removeprefix("layer:")):
        prepare_shot(LineWorld(), make_shot(start, passes=(name,)))


def test_layers_and_background_are_layers_of_the_exr_file(tmp_path):
    layer = np.zeros((4, 6, 4), np.float32)
    layer[..., 0], layer[..., 3] = 1.0, 0.25
    rgb = np.full((4, 6, 3), 0.5, np.float32)
    background = np.full((4, 6, 3), 1.0, np.float32)
    frame = Frame(rgb, layers={"player_1": layer}, background=background)
    write_frame(tmp_path, 3, frame, "digest")
    spec = (file := oiio.ImageInput.open(str(tmp_path / "0003.exr"))).spec()
    pixel = dict(zip(spec.channelnames, file.read_image(oiio.FLOAT)[0, 0], strict=True))
    file.close()
    assert {f"layer.player_1.{each}" for each in "RGBA"} <= set(pixel)
    # Premultiplied, as is the rule in EXR files.
    assert pixel["layer.player_1.R"] == pytest.approx(0.25, abs=1e-3)
    assert pixel["layer.player_1.A"] == pytest.approx(0.25, abs=1e-3)
    assert pixel["background.G"] == pytest.approx(1.0, abs=1e-3)
    assert pixel["R"] == pytest.approx(0.214, abs=1e-3)


def test_a_frame_without_passes_has_no_exr_file(tmp_path, start):  # noqa: F811
    render_shot(LineWorld(), make_shot(start, frames=1), tmp_path / "out")
    assert [path.name for path in (tmp_path / "out").iterdir()] == ["0001.png"]
