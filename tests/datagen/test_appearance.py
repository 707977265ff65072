"""Colours of the recorded people and places."""

import colorsys

import numpy as np

from blender_addon.datagen.appearance import draw_outfits, draw_surroundings, linear


def outfits(count=400):
    return [draw_outfits(np.random.default_rng(seed), 2) for seed in range(count)]


def hue(colour):
    return colorsys.rgb_to_hsv(*colour)[0]


def test_shirts_cover_the_whole_hue_circle_and_are_saturated():
    shirts = [person.shirt for pair in outfits() for person in pair]
    counts = np.histogram([hue(shirt) for shirt in shirts], bins=12, range=(0, 1))[0]
    assert counts.min() > 0.3 * counts.mean()
    assert min(colorsys.rgb_to_hsv(*shirt)[1] for shirt in shirts) >= 0.69


def test_the_two_shirts_of_a_sequence_differ_in_hue():
    for first, second in outfits():
        apart = abs(hue(first.shirt) - hue(second.shirt))
        assert min(apart, 1 - apart) > 0.25


def test_every_colour_can_be_displayed():
    for seed in range(200):
        places = draw_surroundings(np.random.default_rng(seed))
        colours = [places.inner, places.outer, places.wall, *places.panels, places.horizon]
        assert all(0 <= channel <= 1 for colour in colours for channel in colour)


def test_linear_is_the_srgb_curve():
    assert linear((0.0, 0.5, 1.0)) == (0.0, ((0.5 + 0.055) / 1.055) ** 2.4, 1.0, 1.0)
    assert linear((0.04, 0.0, 0.0))[0] == 0.04 / 12.92
