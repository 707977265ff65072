import numpy as np
import pytest
import torch
import toy_world

from pe_runtime.contract.episode import read_dataset, read_episode
from pe_runtime.contract.errors import EpisodeError
from pe_runtime.dataset import load_clips
from pe_runtime.images import read_image, write_png


@pytest.fixture(scope="module")
def root(tmp_path_factory):
    return toy_world.record(
        tmp_path_factory.mktemp("toy") / "data", sequences=3, frames=4, absent=[(1, 2, "left")]
    )


@pytest.mark.parametrize("view", [0, 1])
def test_clips_hold_what_the_episodes_hold(root, view):
    clips = load_clips(root, view)
    _, paths = read_dataset(root)
    assert len(clips) == 3
    assert clips.players == toy_world.PLAYERS
    for number, path in enumerate(paths):
        episode = read_episode(path)
        arrays = episode.arrays
        np.testing.assert_array_equal(clips.intrinsics[number].numpy(), arrays.intrinsics[view])
        np.testing.assert_array_equal(
            clips.world_from_camera[number].numpy(), arrays.world_from_camera[view]
        )
        np.testing.assert_array_equal(clips.boxes[number].numpy(), arrays.boxes[view])
        np.testing.assert_allclose(clips.positions[number].numpy(), arrays.positions, atol=1e-6)
        np.testing.assert_array_equal(clips.actions[number].numpy(), arrays.actions)
        for time in range(4):
            wanted = read_image(episode.frame_path(view, time))
            np.testing.assert_array_equal(
                clips.images[number, time].numpy(), np.round(wanted * 255).astype(np.uint8)
            )


def test_an_absent_player_has_a_nan_box(root):
    boxes = load_clips(root).boxes
    assert torch.isnan(boxes[1, 2, 0]).all()
    assert torch.isfinite(boxes).all(dim=-1).sum() == 3 * 4 * 2 - 1


def test_a_batch_picks_frames_with_their_cameras_and_boxes(root):
    clips = load_clips(root)
    clip, time = torch.tensor([2, 0, 1]), torch.tensor([3, 0, 2])
    batch = clips.batch(clip, time)
    assert batch.images.dtype == torch.float32
    for row, (c, t) in enumerate(zip(clip, time, strict=True)):
        picture = clips.images[c, t].permute(2, 0, 1).float() / 255
        assert torch.equal(batch.images[row], picture)
        assert torch.equal(batch.cameras.intrinsics[row], clips.intrinsics[c, t])
        assert torch.equal(batch.cameras.world_from_camera[row], clips.world_from_camera[c, t])
        assert torch.equal(batch.boxes[row].nan_to_num(-1), clips.boxes[c, t].nan_to_num(-1))
    assert (batch.cameras.width, batch.cameras.height) == (toy_world.WIDTH, toy_world.HEIGHT)
    assert batch.cameras.intrinsics.dtype == torch.float64


def test_a_batch_moves_to_a_device_whole(root):
    batch = load_clips(root).batch(torch.tensor([0]), torch.tensor([1])).to("meta")
    parts = (batch.images, batch.boxes, batch.cameras.intrinsics, batch.cameras.world_from_camera)
    assert {each.device.type for each in parts} == {"meta"}


def test_a_limit_takes_the_first_sequences(root):
    assert torch.equal(load_clips(root, limit=2).images, load_clips(root).images[:2])


def test_a_view_that_was_not_recorded_is_one_clear_error(root):
    with pytest.raises(EpisodeError, match=r"2 camera\(s\); view 2"):
        load_clips(root, view=2)


@pytest.mark.parametrize("limit", [0, None])
def test_no_sequences_is_one_clear_error(root, tmp_path, limit):
    source = root if limit == 0 else toy_world.record(tmp_path / "none", sequences=0)
    with pytest.raises(EpisodeError, match="no complete sequence"):
        load_clips(source, limit=limit)


def test_sequences_of_different_lengths_are_one_clear_error(tmp_path):
    root = toy_world.record(tmp_path / "data", sequences=1, frames=3, views=1)
    info, _ = read_dataset(root)
    toy_world.write_one(root / "00001", info, np.random.default_rng(0), 4, [])
    with pytest.raises(EpisodeError, match="differ in length or size"):
        load_clips(root)


def test_pictures_of_different_sizes_are_one_clear_error(tmp_path):
    root = toy_world.record(tmp_path / "data", sequences=1, frames=2, views=1)
    write_png(root / "00000" / "frames" / "0" / "0001.png", np.zeros((4, 4, 3), np.float32))
    with pytest.raises(EpisodeError):
        load_clips(root)
