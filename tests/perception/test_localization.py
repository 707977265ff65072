import numpy as np
import pytest
import torch
from small_world import HEIGHT, WIDTH, box_of, camera, look_at

from pe_runtime.contract.camera import project
from pe_runtime.geometry.cameras import Cameras
from pe_runtime.perception.localization import locate

NAN = float("nan")


def found(view, *boxes, offset=0.0):
    return locate(Cameras.stack([view]), torch.tensor([boxes], dtype=torch.float32), offset)


def test_an_object_stands_where_its_box_touches_the_ground():
    view = camera()
    places = [(-0.7, 0.3, 0.0), (1.1, -0.4, 0.0)]
    boxes = []
    for place in places:
        ((u, v),), _ = project(view, np.array([place]))
        boxes.append((u - 1, v - 5, u + 1, v))
    positions, valid = found(view, *boxes)
    assert valid.all()
    np.testing.assert_allclose(positions[0].numpy(), places, atol=1e-4)


def test_the_foot_offset_pushes_away_from_the_camera_along_the_ground():
    view = camera(azimuth=0.6)
    box = box_of((0.4, 0.2, 0.0), view)
    (near,), (far,) = (found(view, box, offset=offset)[0][0] for offset in (0.0, 0.25))
    away = near[:2] - torch.from_numpy(view.world_from_camera[:2, 3].copy())
    torch.testing.assert_close(
        (far - near)[:2].double(), 0.25 * away / away.norm(), atol=1e-6, rtol=0
    )
    assert far[2] == 0


def test_an_offset_right_below_the_camera_is_finite():
    down = look_at((0.0, -1e-9, 2.0), (0.0, 0.0, 0.0))
    u, v = down.intrinsics[0, 2], down.intrinsics[1, 2]
    positions, valid = found(down, (u - 1, v - 2, u + 1, v), offset=0.3)
    assert valid.all()
    assert positions.abs().max() <= 0.3 + 1e-4


@pytest.mark.parametrize(
    "box",
    [
        (NAN, NAN, NAN, NAN),
        (3.0, 4.0, NAN, 14.0),
        (3.0, 4.0, float("inf"), 14.0),
        (5.0, 4.0, 5.0, 14.0),
        (3.0, 14.0, 8.0, 14.0),
        (8.0, 4.0, 3.0, 14.0),
        (3.0, 14.0, 8.0, 4.0),
    ],
    ids=["absent", "one nan", "infinite", "no width", "no height", "mirrored", "upside down"],
)
def test_a_box_that_is_none_has_no_position(box):
    positions, valid = found(camera(), box, (10.0, 4.0, 14.0, 12.0), offset=0.1)
    assert valid.tolist() == [[False, True]]
    assert positions[0, 0].tolist() == [0.0, 0.0, 0.0]


@pytest.mark.parametrize("bottom", [HEIGHT / 2 - 0.4, 3.0])
def test_a_foot_at_or_above_the_horizon_is_no_position(bottom):
    level = look_at((0.0, -4.0, 1.0), (0.0, 0.0, 1.0))
    _, valid = found(level, (WIDTH / 2 - 2, 0.0, WIDTH / 2 + 2, bottom), offset=0.1)
    assert not valid.any()


def test_no_objects_give_no_positions():
    positions, valid = locate(Cameras.stack([camera()] * 3), torch.zeros(3, 0, 4))
    assert positions.shape == (3, 0, 3) and valid.shape == (3, 0)


def test_positions_are_float32_on_the_ground():
    positions, _ = found(camera(), (10.0, 4.0, 14.0, 12.0))
    assert positions.dtype == torch.float32
    assert positions[0, 0, 2] == 0


def test_lifted_objects_stand_above_the_ground_point_and_absent_ones_at_the_origin():
    cameras, box = Cameras.stack([camera()]), torch.tensor([[(10.0, 4.0, 14.0, 12.0), (NAN,) * 4]])
    (flat, _), (lifted, valid) = locate(cameras, box), locate(cameras, box, lift=0.25)
    assert torch.equal(lifted[0, 0, :2], flat[0, 0, :2])
    assert lifted[0, 0, 2] == 0.25
    assert lifted[0, 1].tolist() == [0.0, 0.0, 0.0] and valid.tolist() == [[True, False]]
