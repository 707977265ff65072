"""Shots in a made-up world whose every number can be told in advance."""

import dataclasses
import json
from dataclasses import dataclass, field

import numpy as np
import OpenImageIO as oiio  # noqa: N813
import pytest
import torch

from pe_runtime.config import ModelConfig
from pe_runtime.contract.camera import Camera
from pe_runtime.contract.errors import ShotError
from pe_runtime.contract.shot import ObjectTrack, Shot, Start, StyleMix
from pe_runtime.environment import Frame
from pe_runtime.images import read_image, srgb_from_linear, write_png
from pe_runtime.shots import (
    RenderCancelledError,
    frame_path,
    frame_state,
    load_shot,
    prepare_shot,
    read_state,
    render_frames,
    render_shot,
    rollout,
    rollout_key,
)
from pe_runtime.state import EnvironmentState, ObjectState, state_as_dict

PLAYERS = ("player_1", "player_2")
ACTIONS = ("idle", "left", "right")
MOVES = torch.tensor([0.0, -0.5, 0.5])
INTRINSICS = np.array([[10.0, 0, 4], [0, 10, 3], [0, 0, 1]])


def camera(x=0.0):
    pose = np.eye(4)
    pose[0, 3] = x
    return Camera(8, 6, INTRINSICS, pose)


def state(**positions):
    objects = {
        name: ObjectState(
            torch.tensor([x, 0.0, 0.0]), torch.tensor([float(i), 1.0]), torch.zeros(1)
        )
        for i, (name, x) in enumerate(positions.items())
    }
    ground = ObjectState(torch.zeros(3), torch.zeros(1), torch.zeros(0))
    return EnvironmentState(objects | {"ground": ground})


@dataclass
class LineWorld:
    """Players walk half a metre a step, plus the camera's x, plus 0.01 for each step remembered."""

    config: ModelConfig = ModelConfig()
    networks: torch.nn.Module = field(default_factory=lambda: torch.nn.Linear(2, 2))
    playable_names: tuple = PLAYERS
    steps_per_second: float = 5.0
    calls: list = field(default_factory=list)
    drawn: list = field(default_factory=list)

    @property
    def action_names(self):
        return dict.fromkeys(self.playable_names, ACTIONS)

    def encode(self, image, camera, boxes):
        return state(**{name: float(box[0]) for name, box in boxes.items()})

    def step(self, state, actions, camera, memory=None):
        memory = (memory or 0) + 1
        self.calls.append((dict(actions), float(camera.world_from_camera[0, 3])))
        objects = dict(state.objects)
        for name, action in actions.items():
            each = objects[name]
            along = MOVES[action] + float(camera.world_from_camera[0, 3]) + 0.01 * memory
            position = each.position + along * torch.tensor([1.0, 0.0, 0.0])
            objects[name] = dataclasses.replace(each, position=position, pose=each.pose + 1.0)
        return EnvironmentState(objects), memory

    def render(self, state, camera, options=None):
        seen = [
            each.position.sum() + each.style.sum()
            for each in state.objects.values()
            if each.visible
        ]
        rgb = np.full((6, 8, 3), 0.5 + 0.01 * float(sum(seen, torch.zeros(()))), np.float32)
        rgb[0] += np.float32(0.1 * camera.world_from_camera[0, 3])
        self.drawn.append(rgb)
        masks = {name: rgb[..., 0] for name in options.masks}
        return Frame(rgb.clip(0, 1), rgb[..., 1] if options.depth else None, masks)


@pytest.fixture
def start(tmp_path):
    path = tmp_path / "start.json"
    path.write_text(json.dumps(state_as_dict(state(player_1=0.0, player_2=1.0))))
    return Start(state=str(path))


def make_shot(start, frames=13, fps=12.0, **changes):
    content = {
        "version": 1,
        "model": "line",
        "start": start,
        "fps": fps,
        "frame_start": 1,
        "frame_end": frames,
        "cameras": (camera(),) * frames,
        "objects": (ObjectTrack("player_1", ((1, 2),)), ObjectTrack("player_2", ((1, 1),))),
    }
    return Shot(**(content | changes))


def path_of(result, name="player_1"):
    return np.array([float(each[name].position[0]) for each in result.states])


def run(world, shot):
    return rollout(world, read_state(shot.start.state), shot)


def test_frames_at_steps_are_the_models_own_states_and_memory_is_passed_on(start):
    shot = make_shot(start, frames=7, fps=10.0)
    result = run(LineWorld(), shot)
    # Every second frame is a step; the k-th step moves 0.5 + 0.01 k.
    np.testing.assert_allclose(path_of(result)[::2], [0.0, 0.51, 1.03, 1.56], atol=1e-6)
    assert [float(each["player_1"].pose) for each in result.states[::2]] == [0.0, 1.0, 2.0, 3.0]


def test_positions_between_steps_are_linear_and_poses_smooth(start):
    result = run(LineWorld(), make_shot(start, frames=5, fps=20.0))
    np.testing.assert_allclose(path_of(result), [0.51 * i / 4 for i in range(5)], atol=1e-6)
    poses = [float(each["player_1"].pose) for each in result.states]
    np.testing.assert_allclose(poses, [0.0, 0.15625, 0.5, 0.84375, 1.0], atol=1e-6)


@pytest.mark.parametrize("fps", [2.5, 4.999, 12.0, 23.976, 25.0, 29.97, 60.0])
def test_at_any_frame_rate_a_step_that_falls_on_a_frame_is_met_exactly(fps):
    world = LineWorld()
    shot = make_shot(Start(state="unused"), frames=31, fps=fps)
    first = state(player_1=0.0, player_2=1.0)
    walked = path_of(rollout(world, first, shot))
    steps = np.cumsum([0.0] + [0.5 + 0.01 * k for k in range(1, 400)])
    times = np.arange(31) * 5.0 / fps
    np.testing.assert_allclose(walked, np.interp(times, np.arange(400), steps), atol=2e-4)
    assert len(world.calls) == int(np.ceil(times[-1] - 1e-6))


def test_a_step_rate_that_floats_cannot_hold_still_meets_its_frames(start):
    world = LineWorld(steps_per_second=4.8)
    result = run(world, make_shot(start, frames=6, fps=24.0))
    assert len(world.calls) == 1
    assert path_of(result)[5] == np.float32(0.51)


def test_a_step_acts_by_the_key_and_the_camera_at_or_before_its_time(start):
    world = LineWorld()
    track = ObjectTrack("player_1", ((1, 2), (6, 1)))
    cameras = tuple(camera(float(index)) for index in range(13))
    run(world, make_shot(start, objects=(track,), cameras=cameras))
    # Steps are taken at frames 1, 3.4, 5.8, 8.2, 10.6: the key at 6 is not yet there at 5.8.
    assert [actions["player_1"] for actions, _ in world.calls] == [2, 2, 2, 1, 1]
    assert [x for _, x in world.calls] == [0.0, 2.0, 4.0, 7.0, 9.0]


def test_objects_without_keys_stay_and_are_not_stepped(start):
    world = LineWorld()
    result = run(world, make_shot(start, objects=(ObjectTrack("player_1", ((1, 2),)),)))
    assert all(set(actions) == {"player_1"} for actions, _ in world.calls)
    assert set(path_of(result, "player_2")) == {1.0}
    run(still := LineWorld(), make_shot(start, objects=()))
    assert still.calls == []


def test_a_shot_of_one_frame_takes_no_step(start):
    world = LineWorld()
    assert len(run(world, make_shot(start, frames=1)).states) == 1
    assert world.calls == []


def test_a_world_without_playable_objects_is_filmed_all_the_same(tmp_path):
    path = tmp_path / "s.json"
    path.write_text(json.dumps(state_as_dict(state())))
    shot = make_shot(Start(state=str(path)), frames=3, objects=())
    report = render_shot(LineWorld(playable_names=()), shot, tmp_path / "out")
    assert report.written == (1, 2, 3)


def test_a_picture_is_encoded_with_its_camera_and_boxes(tmp_path):
    write_png(tmp_path / "a.png", np.zeros((6, 8, 3), np.uint8))
    boxes = {"player_1": (3.0, 0.0, 5.0, 5.0), "player_2": (1.0, 0.0, 2.0, 5.0)}
    shot = make_shot(Start(str(tmp_path / "a.png"), camera(), boxes))
    assert float(prepare_shot(LineWorld(), shot).rollout.at(1)["player_1"].position[0]) == 3.0


def test_a_picture_of_another_size_than_its_camera_is_refused(tmp_path):
    write_png(tmp_path / "a.png", np.zeros((6, 9, 3), np.uint8))
    with pytest.raises(ShotError, match="9x6.*8x6"):
        prepare_shot(LineWorld(), make_shot(Start(str(tmp_path / "a.png"), camera())))


def test_locations_and_visibility_of_a_frame_replace_the_prediction(start):
    points = tuple((0.1 * index, 2.0, 0.0) for index in range(13))
    seen = tuple(index != 4 for index in range(13))
    track = ObjectTrack("player_1", ((1, 2),), locations=points, visible=seen)
    prepared = prepare_shot(LineWorld(), make_shot(start, objects=(track,)))
    moved = frame_state(prepared, 5)["player_1"]
    np.testing.assert_allclose(moved.position.numpy(), [0.4, 2.0, 0.0], atol=1e-6)
    assert not moved.visible
    assert frame_state(prepared, 6)["player_1"].visible
    # The pose still comes from the rollout.
    assert torch.equal(moved.pose, prepared.rollout.at(5)["player_1"].pose)


def test_styles_are_mixed_by_weight_from_the_frame_on(start, tmp_path):
    other = state(player_1=0.0, player_2=0.0)
    (tmp_path / "other.json").write_text(json.dumps(state_as_dict(other)))
    track = ObjectTrack(
        "player_2",
        styles=(
            StyleMix(3, str(tmp_path / "other.json"), "player_1", 0.25),
            StyleMix(5, None, "player_1", 0.5),
            StyleMix(5, None, "player_2", 0.5),
            StyleMix(7, None, "player_1", 0.0),
        ),
    )
    prepared = prepare_shot(LineWorld(), make_shot(start, objects=(track,)))
    first = [float(frame_state(prepared, f)["player_2"].style[0]) for f in (2, 3, 4, 5, 7)]
    np.testing.assert_allclose(first, [1.0, 0.75, 0.75, 0.5, 1.0])


@pytest.mark.parametrize(
    ("changes", "named"),
    [
        ({"objects": (ObjectTrack("player_3", ((1, 0),)),)}, "did you mean 'player_"),
        ({"objects": (ObjectTrack("ground", ((1, 0),)),)}, "player_1, player_2"),
        ({"objects": (ObjectTrack("player_1", ((4, 3),)),)}, "frame 4.*0 to 2"),
        ({"objects": (ObjectTrack("grund"),)}, "did you mean 'ground'"),
        ({"passes": ("mask:grund",)}, "did you mean 'ground'"),
        ({"objects": (ObjectTrack("player_1", styles=(StyleMix(1, None, "x", 1.0),)),)}, "'x'"),
        (
            {"objects": (ObjectTrack("player_1", styles=(StyleMix(1, None, "ground", 1.0),)),)},
            "same class",
        ),
        (
            {"objects": (ObjectTrack("player_1", styles=(StyleMix(1, "no.json", "x", 1.0),)),)},
            "no.json",
        ),
    ],
    ids=str,
)
def test_what_the_model_does_not_have_is_refused(start, changes, named):
    with pytest.raises(ShotError, match=named):
        prepare_shot(LineWorld(), make_shot(start, **changes))


@pytest.mark.parametrize("text", ["", "{}", '{"objects": {"player_1": {}}}', "[]"])
def test_a_file_that_is_no_state_is_refused_by_name(tmp_path, text):
    (tmp_path / "s.json").write_text(text)
    with pytest.raises(ShotError, match="s.json"):
        read_state(tmp_path / "s.json")
    with pytest.raises(ShotError, match="missing.json"):
        read_state(tmp_path / "missing.json")


def test_a_state_of_another_model_is_refused(tmp_path):
    (tmp_path / "s.json").write_text(json.dumps(state_as_dict(state(player_1=0.0))))
    with pytest.raises(ShotError, match="player_2"):
        prepare_shot(LineWorld(), make_shot(Start(state=str(tmp_path / "s.json"))))


def test_frames_come_in_order_with_progress_and_only_inside_the_shot(start):
    prepared, done = prepare_shot(LineWorld(), make_shot(start)), []
    numbers = [
        number
        for number, _ in render_frames(LineWorld(), prepared, [5, 2, 5], lambda *a: done.append(a))
    ]
    assert numbers == [2, 5]
    assert done == [(1, 2), (2, 2)]
    with pytest.raises(ShotError, match="14.*1 to 13"):
        next(render_frames(LineWorld(), prepared, [14]))


def test_rendering_stops_when_asked_and_keeps_finished_frames(start, tmp_path):
    world = LineWorld()
    with pytest.raises(RenderCancelledError, match="after 3 of 13"):
        render_shot(world, make_shot(start), tmp_path, should_stop=lambda: len(world.drawn) == 3)
    assert sorted(path.name for path in tmp_path.glob("*.png")) == [
        "0001.png", "0002.png", "0003.png",
    ]  # fmt: skip


def test_frame_12_alone_is_byte_for_byte_frame_12_of_the_range(start, tmp_path):
    cameras = tuple(camera(0.1 * index) for index in range(13))
    shot = make_shot(start, cameras=cameras, passes=("depth",))
    world = LineWorld()
    render_shot(world, shot, tmp_path / "all")
    render_shot(world, shot, tmp_path / "one", frames=[12])
    for ending in (".png", ".exr"):
        one = frame_path(tmp_path / "one", 12).with_suffix(ending).read_bytes()
        assert one == frame_path(tmp_path / "all", 12).with_suffix(ending).read_bytes()
    assert sorted(path.name for path in (tmp_path / "one").iterdir()) == ["0012.exr", "0012.png"]


def test_passes_are_written_as_channels_beside_linear_colours(start, tmp_path):
    world, shot = LineWorld(), make_shot(start, passes=("depth", "mask:player_2"))
    render_shot(world, shot, tmp_path, frames=[1])
    source = oiio.ImageInput.open(str(tmp_path / "0001.exr"))
    names, pixels = source.spec().channelnames, source.read_image()
    assert sorted(names) == ["B", "G", "R", "Z", "mask.player_2"]
    np.testing.assert_array_equal(pixels[..., names.index("Z")], world.drawn[0][..., 1])
    encoded = srgb_from_linear(pixels[..., names.index("R")])
    np.testing.assert_allclose(encoded, world.drawn[0][..., 0], atol=1e-6)
    np.testing.assert_allclose(read_image(tmp_path / "0001.png"), world.drawn[0], atol=0.5 / 255)


def test_only_frames_whose_inputs_changed_are_drawn_again(start, tmp_path):
    world, shot = LineWorld(), make_shot(start)
    assert len(render_shot(world, shot, tmp_path).written) == 13
    assert render_shot(world, shot, tmp_path).kept == tuple(range(1, 14))
    # A moved camera touches its own frame, and the states of steps that are taken through it.
    cameras = (*shot.cameras[:12], camera(0.5))
    moved = dataclasses.replace(shot, cameras=cameras)
    assert render_shot(world, moved, tmp_path).written == (13,)
    (tmp_path / "0004.png").write_bytes(b"torn")
    assert render_shot(world, moved, tmp_path).written == (4,)
    assert len(render_shot(world, moved, tmp_path, resume=False).written) == 13
    other_weights = LineWorld()
    assert len(render_shot(other_weights, moved, tmp_path).written) == 13
    draft = dataclasses.replace(moved, quality="draft")
    assert len(render_shot(other_weights, draft, tmp_path).written) == 13


def test_progress_counts_kept_and_drawn_frames_together(start, tmp_path):
    render_shot(LineWorld(), shot := make_shot(start, objects=()), tmp_path, frames=[1, 2])
    world, done = LineWorld(), []
    render_shot(world, shot, tmp_path, frames=[1, 2, 3], on_progress=lambda *a: done.append(a))
    assert done[-1] == (3, 3)


def test_a_missing_pass_file_is_drawn_again(start, tmp_path):
    world, shot = LineWorld(), make_shot(start, frames=2, passes=("depth",))
    render_shot(world, shot, tmp_path)
    (tmp_path / "0002.exr").unlink()
    assert render_shot(world, shot, tmp_path).written == (2,)


def test_relative_paths_in_a_shot_file_count_from_its_folder(start, tmp_path):
    track = ObjectTrack("player_1", styles=(StyleMix(1, "start.json", "player_2", 1.0),))
    shot = make_shot(Start(state="start.json"), objects=(track,))
    (tmp_path / "shot.json").write_text(shot.to_json())
    loaded = load_shot(tmp_path / "shot.json")
    assert loaded.start.state == str(tmp_path / "start.json")
    assert frame_state(prepare_shot(LineWorld(), loaded), 1)["player_1"].style[0] == 1.0
    (tmp_path / "broken.json").write_text("{")
    for name in ("broken.json", "missing.json"):
        with pytest.raises(ShotError, match=name):
            load_shot(tmp_path / name)


def test_shots_that_differ_in_overrides_only_share_their_rollout(start):
    shot = make_shot(start)
    hidden = ObjectTrack("player_1", ((1, 2),), visible=(False,) * 13)
    same = dataclasses.replace(shot, objects=(hidden, shot.objects[1]), quality="draft")
    assert rollout_key(same) == rollout_key(shot)
    other = dataclasses.replace(shot, objects=(ObjectTrack("player_1", ((1, 1),)),))
    assert rollout_key(other) != rollout_key(shot)
    before = rollout_key(shot)
    with open(start.state, "a") as file:  # noqa: PTH123
        file.write(" ")
    assert rollout_key(shot) != before
