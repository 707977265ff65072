"""Players in a picture: the surest silhouettes, named from left to right."""

import numpy as np

from pe_runtime.environment import MODELS
from pe_runtime.evaluation.detector_network import load_detector
from pe_runtime.evaluation.finding_people import find_players
from pe_runtime.evaluation.rules import OWN_DETECTOR
from pe_runtime.images import read_image
from pe_runtime.shots.clips import start_from_clip


def silhouettes(*people):
    """Logits of upright rectangles at columns."""
    found = np.full((100, 200), -4.0, np.float32)
    for left, logit in people:
        found[20:80, left : left + 20] = logit
    return found


def test_names_go_from_left_to_right_whoever_is_surer():
    found = find_players(silhouettes((150, 5.0), (30, 1.0)), ["a", "b"])
    assert found["a"][0] == (30.0, 20.0, 50.0, 80.0) and found["b"][0][0] == 150.0
    assert 0.5 < found["a"][1] < found["b"][1] < 1.0


def test_of_more_people_than_names_the_surest_are_taken():
    found = find_players(silhouettes((10, 0.5), (70, 3.0), (130, 2.0)), ["a", "b"])
    assert [box[0] for box, _ in found.values()] == [70.0, 130.0]


def test_names_without_a_person_are_left_out():
    assert find_players(silhouettes(), ["a"]) == {}
    assert list(find_players(silhouettes((70, 3.0)), ["a", "b"])) == ["a"]


def test_the_players_of_the_sample_clip_are_found_where_its_boxes_are():
    start = start_from_clip(MODELS / "duel_clip")
    picture, names = read_image(start.image), sorted(start.boxes, key=lambda n: start.boxes[n][0])
    found = find_players(load_detector(OWN_DETECTOR).logits(picture), names)
    for name in names:
        np.testing.assert_allclose(found[name][0], start.boxes[name], atol=3.0)
        assert found[name][1] > 0.9
