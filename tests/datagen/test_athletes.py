"""Bodies of tennis players: closed meshes on a skeleton, poses that stand on the ground."""

from collections import Counter, defaultdict
from itertools import pairwise

import numpy as np
import pytest

from blender_addon.datagen.athlete_motion import (
    Words,
    draw_movement,
    euler_matrix,
    standing_rise,
)
from blender_addon.datagen.athlete_shape import body_shape, skeleton
from blender_addon.datagen.kits import draw_kits, uniform_kit

IDLE, RUN, SWING = range(3)
WORDS = Words(np.array([(0.0, 0.0), (1.0, 0.0), (0.0, 0.0)]), SWING)
SHAPES = [body_shape(skirt, hair) for skirt in (False, True) for hair in (False, True)]


def movement(actions, seed=0, faces_camera=True):
    return draw_movement(np.random.default_rng(seed), np.array(actions), WORDS, faces_camera)


@pytest.mark.parametrize("shape", SHAPES)
def test_a_body_is_as_tall_as_a_person_and_stands_on_the_ground(shape):
    low, high = shape.corners.min(0), shape.corners.max(0)
    assert low[2] == pytest.approx(0.0, abs=0.02)
    assert high[2] == pytest.approx(1.80, abs=0.03)
    assert high[0] - low[0] < 0.7


@pytest.mark.parametrize("shape", SHAPES)
def test_every_surface_is_closed_and_faces_outward(shape):
    edges = Counter()
    for face in shape.faces:
        edges.update(pairwise((*face, face[0])))
    assert set(edges.values()) == {1}
    open_edges = [edge for edge in edges if edge[::-1] not in edges]
    assert open_edges == [], "each edge is walked once in each direction"
    volume = 0.0
    for face in shape.faces:
        for b, c in pairwise(face[1:]):
            volume += np.linalg.det(shape.corners[[face[0], b, c]]) / 6
    # Tubes overlap a little, and people weigh 50 to 110 kg.
    assert 0.05 < volume < 0.11


@pytest.mark.parametrize("shape", SHAPES)
def test_every_corner_hangs_wholly_on_bones_of_the_skeleton(shape):
    shares = defaultdict(float)
    for bone, numbers, share in shape.weights:
        assert bone in skeleton()
        for number in numbers:
            shares[number] += share
    assert set(shares) == set(range(len(shape.corners)))
    assert set(shares.values()) == {1.0}


def test_bones_come_after_their_parents_and_meet_them():
    seen = {""}
    for name, bone in skeleton().items():
        assert bone.parent in seen
        seen.add(name)


@pytest.mark.parametrize("shape", SHAPES)
def test_a_kit_has_a_colour_for_every_part(shape):
    for part in set(shape.parts):
        assert len(getattr(uniform_kit(), part)) == 3


def test_kits_differ_and_opponents_do_not_look_alike():
    pairs = [draw_kits(np.random.default_rng(seed), 2) for seed in range(60)]
    assert len({one.shirt for one, _ in pairs}) > 40
    assert {one.skirt for one, _ in pairs} == {True, False}
    assert len({one.skin for one, _ in pairs}) > 10


def test_upright_legs_need_no_lift_and_bent_ones_lower_the_body():
    rest = dict.fromkeys(skeleton(), (0.0, 0.0, 0.0))
    assert standing_rise(rest) == pytest.approx(0.0)
    bent = rest | {
        f"{part}.{side}": (turn, 0.0, 0.0)
        for side in ("left", "right")
        for part, turn in (("thigh", -0.6), ("shin", 1.2), ("foot", -0.6))
    }
    # Thigh and shin shorten by the cosine, the sole stays flat.
    assert standing_rise(bent) == pytest.approx(-0.82 * (1 - np.cos(0.6)), abs=1e-6)


def test_euler_angles_turn_about_x_then_y_then_z():
    quarter = np.pi / 2
    forward = euler_matrix((-quarter, 0.0, 0.0)) @ (0, 0, -1)
    np.testing.assert_allclose(forward, (0, -1, 0), atol=1e-12)
    np.testing.assert_allclose(
        euler_matrix((0.0, 0.0, quarter)) @ (0, -1, 0), (1, 0, 0), atol=1e-12
    )
    both = euler_matrix((-quarter, 0.0, quarter)) @ (0, 0, -1)
    np.testing.assert_allclose(both, (1, 0, 0), atol=1e-12)


def test_legs_stride_in_turn_while_running_and_rest_while_idle():
    running = movement([RUN] * 40).poses[5:]
    left, right = (np.array([pose[f"thigh.{s}"][0] for pose in running]) for s in ("left", "right"))
    assert np.ptp(left) > 1.0
    assert np.corrcoef(left, right)[0, 1] < -0.9
    waiting = np.array([pose["thigh.left"][0] for pose in movement([IDLE] * 40).poses[5:]])
    assert np.ptp(waiting) < 0.35


def test_knees_never_bend_forward_nor_elbows_backward():
    for seed in range(10):
        for pose in movement([RUN, RUN, SWING, SWING, SWING, IDLE, SWING, RUN, RUN], seed).poses:
            for side in ("left", "right"):
                assert pose[f"shin.{side}"][0] >= 0
                assert pose[f"forearm.{side}"][0] <= 0


def test_a_held_swing_goes_on_to_follow_through_and_back():
    poses = movement([IDLE, SWING, SWING, SWING, SWING]).poses
    arms = [pose["upper_arm.right"] for pose in poses[2:]]
    assert len({tuple(np.round(arm, 6)) for arm in arms[:3]}) == 3
    assert arms[3] == arms[0], "the fourth swing hits again"


def test_a_swing_fades_within_two_steps():
    poses = movement([IDLE, SWING, IDLE, IDLE, IDLE]).poses
    reach = [abs(pose["upper_arm.right"][1]) for pose in poses]
    assert reach[2] > 1.1
    assert abs(reach[4] - reach[1]) < 0.1


def test_running_away_from_where_one_looks_strides_backwards():
    words = Words(np.array([(0.0, 0.0), (0.0, 1.0), (0.0, -1.0)]), 9)
    forth, back = (
        draw_movement(np.random.default_rng(1), np.full(3, a), words, True) for a in (2, 1)
    )
    lift = [[pose["shin.left"][0] for pose in each.poses] for each in (forth, back)]
    assert lift[0][0] == lift[1][0]
    assert lift[0][2] != lift[1][2]
