"""The exploring camera of `duel-camera`, without Blender; and that `duel` draws what it drew."""

import numpy as np
import pytest

from blender_addon.datagen.appearance import draw_outfits, draw_surroundings
from blender_addon.datagen.motion import draw_sequence
from blender_addon.datagen.neighbourhood import SMALLEST_PERSON, explore
from blender_addon.datagen.viewpoints import shows_person

# Sequence 0 of seed 1: data sets that are already recorded must be found again.
DUEL_FEET = (-2.639037, 1.718733, 0.0, 1.533566, -1.35772, 0.0)
DUEL_EYE = (1.006959, -7.608737, 2.962802)
DUEL_ZENITH = (0.3010594, 0.5478725, 0.7348742)
DUEL_SHIRT = (0.8717212, 0.0928613, 0.4593521)


@pytest.fixture(scope="module")
def pairs():
    """(plan of duel, path of the exploring camera)."""
    plans = [draw_sequence(5, number) for number in range(20)]
    return [
        (plan, explore(np.random.default_rng(k), plan.views[0], plan.motion.positions))
        for k, plan in enumerate(plans)
    ]


def test_the_exploring_camera_starts_where_the_first_one_does(pairs):
    for plan, path in pairs:
        np.testing.assert_allclose(path[0].eye, plan.views[0][0].eye, atol=1e-12)
        assert len(path) == len(plan.views[0])


def test_it_moves_smoothly_and_stays_in_the_neighbourhood(pairs):
    farthest = []
    for _, path in pairs:
        eyes = np.array([view.eye for view in path])
        away = np.linalg.norm(eyes - eyes[0], axis=1)
        farthest.append(away.max())
        assert np.linalg.norm(np.diff(eyes, axis=0), axis=1).max() < 1.0
        assert eyes[:, 2].min() >= 1.4 - 1e-9
    assert 0.7 < min(farthest) < max(farthest) < 3.5


def test_it_keeps_everybody_in_the_picture(pairs):
    for plan, path in pairs:
        for view, feet in zip(path, plan.motion.positions, strict=True):
            assert all(shows_person(view, foot, SMALLEST_PERSON) for foot in feet)


def test_duel_draws_what_it_always_drew():
    plan = draw_sequence(1, 0)
    np.testing.assert_allclose(plan.motion.positions[-1].ravel(), DUEL_FEET, atol=1e-6)
    np.testing.assert_allclose(plan.views[1][-1].eye, DUEL_EYE, atol=1e-6)
    np.testing.assert_allclose(draw_surroundings(plan.rng).zenith, DUEL_ZENITH, atol=1e-6)
    np.testing.assert_allclose(draw_outfits(plan.rng, 2)[1].shirt, DUEL_SHIRT, atol=1e-6)
