"""Where patches fall: weights, sizes, and boxes that are no boxes."""

from dataclasses import replace

import pytest
import torch
from small_world import small_config, small_training

from pe_runtime.contract.errors import ConfigError
from pe_runtime.training.patches import cut, patch_plan

NAN, INFINITY = float("nan"), float("inf")
FRAME = (48, 80)
NAMES = ("player_1", "player_2")
# A small player at the left, one nine times as large at the right.
BOXES = torch.tensor([[4.0, 16.0, 12.0, 24.0], [48.0, 20.0, 72.0, 44.0]])


def plan(places="middle", share=1.0, **weights):
    training = small_training(
        player_patches=share, patch_weights=weights, patch_places=places, patch_height=16
    )
    return patch_plan(small_config(), training, NAMES, FRAME)


def middles(planned, boxes=BOXES, count=600):
    torch.manual_seed(0)
    return planned.corners(boxes.expand(count, *boxes.shape)) + 8.0


def share_of_second(found):
    """Patches are 16 pixels wide, the players' middles at 8 and at 60."""
    return float((found[:, 1] > 34).float().mean())


def test_players_get_as_many_patches_as_their_weights_say():
    assert share_of_second(middles(plan())) == pytest.approx(0.5, abs=0.06)
    assert share_of_second(middles(plan(player_1=3.0))) == pytest.approx(0.25, abs=0.06)
    assert share_of_second(middles(plan(player_2=0.0))) == 0


def test_a_class_speaks_for_its_objects_unless_they_speak_for_themselves():
    assert plan(player=2.0).weights.tolist() == [2, 2]
    assert plan(player=2.0, player_2=0.5).weights.tolist() == [2, 0.5]


def test_a_weight_of_nothing_that_is_there_is_refused():
    with pytest.raises(ConfigError, match=r"'goalkeeper'.*player, player_1, player_2"):
        plan(goalkeeper=1.0)
    with pytest.raises(ConfigError, match="patch_weights"):
        plan(player=-1.0)
    with pytest.raises(ConfigError, match="patch_places"):
        plan(places="somewhere")


def test_uniform_patches_count_every_pixel_alike_and_so_prefer_the_large():
    assert share_of_second(middles(plan("uniform"))) == pytest.approx(0.9, abs=0.04)


def test_inverse_size_fills_the_box_whatever_its_size():
    found = middles(plan("inverse-size"))
    assert share_of_second(found) == pytest.approx(0.5, abs=0.06)
    large = found[found[:, 1] > 34]
    # Corners are lowered to the grid of 4 pixels, and kept within the picture.
    assert 44 < large[:, 1].min() < 54 and 64 < large[:, 1].max() <= 72
    assert large[:, 0].min() <= 24 and large[:, 0].max() == 40


def test_patches_near_the_middle_stay_within_a_quarter_patch_of_it():
    found = middles(plan(player_1=0.0))
    assert (found - torch.tensor([32.0, 60.0])).abs().max() <= 4 + 4


@pytest.mark.parametrize("places", ["middle", "inverse-size", "uniform"])
@pytest.mark.parametrize(
    "box",
    [
        (NAN,) * 4,
        (0.0, INFINITY, 4.0, 8.0),
        (30.0, 30.0, 30.0, 30.0),
        (40.0, 30.0, 20.0, 40.0),
        (-9.0, 4.0, -2.0, 8.0),
        (90.0, 4.0, 99.0, 8.0),
    ],
    ids=["absent", "infinite", "empty", "turned over", "left of the picture", "right of it"],
)
def test_what_is_no_box_gets_no_patch(places, box):
    boxes = torch.stack([BOXES[0], torch.tensor(box)])
    found = middles(plan(places), boxes, 50)
    assert found[:, 1].max() < 30, "all are around the other player"
    alone = torch.tensor(box).expand(2, 4)
    anywhere = middles(plan(places), alone, 50)
    assert anywhere.min() >= 8 and len(anywhere.unique(dim=0)) > 20


def test_without_players_or_with_all_weights_zero_patches_fall_anywhere():
    nobody = replace(plan(), weights=torch.zeros(0))
    for planned, boxes in ((nobody, torch.zeros(0, 4)), (plan(player=0.0), BOXES)):
        found = middles(planned, boxes, 100)
        assert found[:, 1].min() < 20 and found[:, 1].max() > 60


def test_cut_takes_rows_first():
    image = torch.arange(2 * 3 * 6 * 8.0).reshape(2, 3, 6, 8)
    found = cut(image, torch.tensor([[1, 4], [2, 0]]), (3, 2))
    assert torch.equal(found[0], image[0, :, 1:4, 4:6])
    assert torch.equal(found[1], image[1, :, 2:5, 0:2])
