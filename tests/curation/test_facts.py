"""What is said about data sets: counts, shares, sizes, and the sheet of pictures."""

import numpy as np
import OpenImageIO
import pytest
from small_dataset import ACTIONS, FRAMES, HEIGHT, WIDTH, write_small

from pe_runtime.contract.episode import DatasetInfo, write_dataset
from pe_runtime.contract.errors import EpisodeError
from pe_runtime.curation.disturbing import disturb_dataset
from pe_runtime.curation.facts import read_facts
from pe_runtime.curation.noise import Noise
from pe_runtime.curation.sheet import BAND, MARGIN, write_dataset_sheet


@pytest.fixture
def clean(tmp_path):
    return write_small(tmp_path / "clean", views=2)


def test_episodes_pictures_and_bytes_are_counted(clean):
    facts = read_facts(clean)
    assert (facts.episodes, facts.pictures) == (2, 2 * 2 * FRAMES)
    assert facts.bytes == sum(p.stat().st_size for p in clean.rglob("*") if p.is_file())
    assert facts.noise == {}


def test_heights_presence_and_actions_are_told_of_each_player(clean):
    players = read_facts(clean).players
    assert players["far"].present == pytest.approx(1 - 1 / FRAMES)
    assert players["near"].present == 1.0
    assert players["far"].heights == pytest.approx((10, 10, 10), abs=1e-4)
    assert players["near"].heights == pytest.approx((20, 20, 20), abs=1e-4)
    assert players["near"].actions == dict(zip(ACTIONS, (0.0, 0.0, 1.0), strict=True))


def test_the_noise_of_a_disturbed_data_set_is_told(clean, tmp_path):
    disturb_dataset(clean, tmp_path / "noisy", Noise(focal=0.25))
    assert read_facts(tmp_path / "noisy").noise["focal"] == 0.25


def test_a_data_set_without_episodes_is_told_of_too(tmp_path):
    write_dataset(tmp_path, DatasetInfo("court", 0, 4, 5.0, 8, 6, ("far",), (), 1))
    facts = read_facts(tmp_path)
    assert (facts.episodes, facts.pictures) == (0, 0)
    assert facts.as_dict()["players"] == {"far": {"present": 0.0, "heights": [], "actions": {}}}


def test_a_sheet_shows_sequences_below_one_another_with_their_boxes(clean, tmp_path):
    write_dataset_sheet({"": clean}, tmp_path / "sheet.png", sequences=2, moments=3)
    sheet = OpenImageIO.ImageBuf(str(tmp_path / "sheet.png")).get_pixels("uint8")
    height, width = 4 * HEIGHT + BAND + MARGIN, 4 * WIDTH + MARGIN
    assert sheet.shape == (2 * height, 3 * width, 3)
    # Frame 0 lacks the far player: only the near one's colour is there.
    colours = {tuple(pixel) for pixel in sheet[:height, :width].reshape(-1, 3)}
    assert (60, 220, 255) in colours
    assert (255, 210, 40) not in colours
    assert (255, 210, 40) in {tuple(p) for p in sheet[:height, width:].reshape(-1, 3)}


def test_every_split_gets_its_share_of_the_sheet(clean, tmp_path):
    write_small(tmp_path / "val", episodes=1)
    roots = {"train": clean, "val": tmp_path / "val"}
    write_dataset_sheet(roots, tmp_path / "sheet.png", sequences=4, moments=1)
    sheet = OpenImageIO.ImageBuf(str(tmp_path / "sheet.png")).get_pixels("uint8")
    assert sheet.shape[0] == 3 * (4 * HEIGHT + BAND + MARGIN)
    assert np.ptp(sheet[-BAND:]) > 100, "there is text below the last picture"


def test_a_sheet_of_nothing_is_an_error(tmp_path):
    write_dataset(tmp_path, DatasetInfo("court", 0, 4, 5.0, 8, 6, ("far",), (), 1))
    with pytest.raises(EpisodeError, match="no complete sequence to show"):
        write_dataset_sheet({"": tmp_path}, tmp_path / "sheet.png")
