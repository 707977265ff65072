"""The person detector: learning from masks, storing, and the one that comes along."""

import json

import numpy as np
import pytest
import torch
from toy_world import HEIGHT, WIDTH, find_cards, record

from pe_runtime.checkpoint import load_checkpoint, save_checkpoint
from pe_runtime.contract.episode import read_dataset, read_episode
from pe_runtime.contract.errors import CheckpointError, EpisodeError
from pe_runtime.evaluation.detector_network import (
    PersonDetector,
    SilhouetteNetwork,
    load_detector,
)
from pe_runtime.evaluation.detector_training import (
    DetectorTraining,
    detector_figures,
    silhouette_loss,
    train_detector,
)
from pe_runtime.evaluation.rules import OWN_DETECTOR
from pe_runtime.images import read_image, write_png


@pytest.fixture(scope="module")
def masked(tmp_path_factory):
    """A toy data set with the masks that a recorder writes."""
    root = record(tmp_path_factory.mktemp("toy"), sequences=4, views=1)
    for folder in read_dataset(root)[1]:
        episode = read_episode(folder)
        for frame in range(episode.arrays.frames):
            shown = find_cards(read_image(episode.frame_path(0, frame)))
            path = episode.mask_path(0, frame)
            path.parent.mkdir(parents=True, exist_ok=True)
            write_png(path, shown.astype(np.uint8))
    return root


@pytest.fixture(scope="module")
def trained(masked, tmp_path_factory):
    path = tmp_path_factory.mktemp("detector") / "cards.safetensors"
    return train_detector(masked, path, DetectorTraining(steps=60, batch=8))


def test_a_detector_learns_from_masks_to_find_what_they_show(masked, trained):
    figures = detector_figures(load_detector(trained), masked)
    assert figures["boxes"] == 4 * 6 * 2
    assert figures["recall"] > 0.8
    assert figures["silhouette_iou"] > 0.5
    assert figures["centre_error"] < 3


def test_the_same_seed_trains_the_same_detector(masked, trained, tmp_path):
    steps = DetectorTraining(steps=3, batch=2)
    first, again = (train_detector(masked, tmp_path / name, steps) for name in ("a", "b"))
    assert first.read_bytes() == again.read_bytes()


def test_a_detectors_file_names_its_data_set_and_no_folder_of_a_machine(trained, masked):
    assert load_checkpoint(trained)[0]["data"] == "/".join(masked.parts[-2:])
    assert load_checkpoint(OWN_DETECTOR)[0]["data"] == "duel/train"


def test_boxes_are_in_pixels_of_the_picture_whatever_its_size(trained, masked):
    detector = load_detector(trained)
    episode = read_episode(read_dataset(masked)[1][0])
    picture = read_image(episode.frame_path(0, 0))
    small, large = detector(picture), detector(picture.repeat(2, axis=0).repeat(2, axis=1))
    assert detector.silhouette(picture).shape == (HEIGHT, WIDTH)
    np.testing.assert_allclose(np.array(large) / 2, small, atol=1.5)


def test_a_data_set_without_sequences_teaches_nothing(tmp_path):
    with pytest.raises(EpisodeError, match="no complete sequence"):
        train_detector(record(tmp_path, sequences=0), tmp_path / "d.safetensors")


def test_a_model_is_no_detector(tmp_path):
    save_checkpoint(tmp_path / "m.safetensors", {"a": torch.zeros(1)}, {"kind": "model"})
    with pytest.raises(CheckpointError, match="no detector but of kind 'model'"):
        load_detector(tmp_path / "m.safetensors")


def test_the_loss_of_a_right_answer_is_near_zero_and_of_a_missed_person_above_one():
    mask = torch.zeros(1, 8, 8)
    mask[0, 2:4, 2:4] = 1
    right = silhouette_loss(40 * mask - 20, mask)
    missed = silhouette_loss(torch.full_like(mask, -20.0), mask)
    assert float(right) < 0.01
    assert float(missed) > 1.0


def test_the_detector_that_comes_along_is_small_and_finds_nobody_on_an_empty_court():
    assert OWN_DETECTOR.stat().st_size < 300_000
    detector = load_detector(OWN_DETECTOR)
    court = np.zeros((144, 256, 3), np.float32)
    court[:60], court[60:] = (0.5, 0.5, 0.45), (0.4, 0.45, 0.5)
    assert detector(court) == []


def test_the_detector_that_comes_along_finds_the_players_of_the_built_in_clip():
    from pe_runtime.environment import MODELS

    figures = detector_figures(load_detector(OWN_DETECTOR), MODELS / "duel_clip")
    assert figures["recall"] == 1.0
    assert figures["precision"] == 1.0
    assert figures["centre_error"] < 1.5
    assert json.dumps(figures)


def test_an_untrained_network_gives_a_logit_for_every_pixel():
    network = SilhouetteNetwork((4, 4, 4, 4))
    assert network(torch.zeros(2, 3, 32, 48)).shape == (2, 32, 48)
    shown = PersonDetector(network, 48).silhouette(np.zeros((30, 44, 3), np.float32))
    assert shown.shape == (30, 44)
