import json
import math

import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from pe_runtime.contract.errors import ConfigError
from pe_runtime.state import (
    EnvironmentState,
    ObjectState,
    blend,
    hide,
    move,
    repose,
    restyle,
    show,
    state_as_dict,
    state_from_dict,
    turn,
)

floats = st.floats(width=32, allow_nan=False, allow_infinity=False)


def codes(length):
    return st.lists(floats, min_size=length, max_size=length)


@st.composite
def states(draw):
    return EnvironmentState(
        {
            name: ObjectState(
                torch.tensor(draw(codes(3))),
                torch.tensor(draw(codes(4))),
                torch.tensor(draw(codes(2 if name != "ground" else 0))),
                draw(st.booleans()),
            )
            for name in ("ground", "one", "two")
        }
    )


def plain(offset=0.0):
    return EnvironmentState(
        {
            name: ObjectState(
                torch.tensor([1.0, 2.0, 0.0]) + offset + place,
                torch.arange(4.0) - offset,
                torch.tensor([0.5, -0.5]) * (1 + offset),
            )
            for place, name in enumerate(("one", "two"))
        }
    )


def same(a, b):
    return state_as_dict(a) == state_as_dict(b)


@given(states())
def test_json_round_trip_is_exact_to_the_bit(state):
    again = state_from_dict(json.loads(json.dumps(state_as_dict(state))))
    assert list(again.objects) == list(state.objects)
    for name, each in state.objects.items():
        found = again[name]
        assert found.visible == each.visible
        for key in ("position", "style", "pose"):
            mine, theirs = getattr(each, key), getattr(found, key)
            assert mine.dtype == theirs.dtype == torch.float32
            assert torch.equal(mine.view(torch.int32), theirs.view(torch.int32))


@pytest.mark.parametrize(
    ("act", "key", "value"),
    [
        (move, "position", torch.tensor([7.0, 8.0, 9.0])),
        (restyle, "style", torch.ones(4)),
        (repose, "pose", torch.ones(2)),
    ],
)
def test_a_manipulation_changes_one_attribute_of_one_object_of_a_new_state(act, key, value):
    before = plain()
    after = act(before, "two", value)
    assert torch.equal(getattr(after["two"], key), value)
    assert same(before, plain()), "the old state is as it was"
    assert after["one"] is before["one"]
    others = {"position", "style", "pose"} - {key}
    assert all(getattr(after["two"], k) is getattr(before["two"], k) for k in others)


def test_hiding_and_showing_are_undone_by_each_other():
    hidden = hide(plain(), "one")
    assert not hidden["one"].visible and hidden["two"].visible
    assert same(show(hidden, "one"), plain())


@pytest.mark.parametrize("act", [restyle, repose])
def test_a_code_of_another_length_is_refused(act):
    with pytest.raises(ConfigError, match="'one'.*7 were given"):
        act(plain(), "one", torch.zeros(7))


@pytest.mark.parametrize("act", [hide, show, lambda s, n: move(s, n, torch.zeros(3))])
def test_an_unknown_object_is_refused_and_the_known_ones_are_named(act):
    with pytest.raises(ConfigError, match="'three'.*one, two"):
        act(plain(), "three")


@given(states(), states())
def test_the_ends_of_a_blend_are_the_very_numbers(a, b):
    assert same(blend(a, b, 0.0), a)
    for name, each in blend(a, b, 1.0).objects.items():
        assert torch.equal(each.position, b[name].position)
        assert torch.equal(each.style, b[name].style)
        assert torch.equal(each.pose, b[name].pose)
        assert each.visible == a[name].visible


def test_the_middle_of_a_blend_is_the_mean():
    a, b = plain(), plain(2.0)
    for name, each in blend(a, b, 0.5).objects.items():
        torch.testing.assert_close(each.position, (a[name].position + b[name].position) / 2)
        torch.testing.assert_close(each.style, (a[name].style + b[name].style) / 2)
        torch.testing.assert_close(each.pose, (a[name].pose + b[name].pose) / 2)


def test_blending_states_of_different_objects_is_refused():
    other = EnvironmentState({"one": plain()["one"]})
    with pytest.raises(ConfigError, match="'two'"):
        blend(plain(), other, 0.5)


def changed(path, value):
    document = state_as_dict(plain())
    target = document
    for key in path[:-1]:
        target = target[key]
    target[path[-1]] = value
    return document


@pytest.mark.parametrize(
    "document",
    [
        {},
        [],
        None,
        {"objects": [1]},
        {"objects": {"one": None}},
        {"objects": {"one": {"position": [0, 0, 0], "style": []}}},
        changed(("objects", "one", "position"), [1.0, 2.0]),
        changed(("objects", "one", "position"), [1.0, 2.0, float("nan")]),
        changed(("objects", "one", "position"), "here"),
        changed(("objects", "one", "style"), [[1.0], [2.0]]),
        changed(("objects", "one", "style"), [1.0, "x"]),
        changed(("objects", "one", "style"), [1.0, float("inf")]),
        changed(("objects", "one", "style"), [1.0, 1e300]),
        changed(("objects", "one", "pose"), None),
        changed(("objects", "one", "pose"), 3.0),
    ],
)
def test_a_malformed_state_is_one_clear_error(document):
    with pytest.raises(ConfigError):
        state_from_dict(document)


def test_an_empty_state_is_a_state():
    assert state_from_dict(state_as_dict(EnvironmentState({}))).objects == {}


@pytest.mark.parametrize("change", [{"format": 99}, {"format": None}])
def test_a_state_of_another_format_is_refused(change):
    with pytest.raises(ConfigError, match="format 1"):
        state_from_dict(state_as_dict(plain()) | change)


def test_visibility_must_be_true_or_false():
    document = state_as_dict(plain())
    next(iter(document["objects"].values()))["visible"] = "no"
    with pytest.raises(ConfigError, match="true or false"):
        state_from_dict(document)


def test_a_heading_is_turned_stored_and_read_back():
    turned = turn(plain(), "one", 2.5)
    assert turned["one"].heading == 2.5
    assert turned["two"].heading == plain()["two"].heading == 0.0
    stored = json.loads(json.dumps(state_as_dict(turned)))
    assert state_from_dict(stored)["one"].heading == 2.5


def test_a_state_from_before_there_were_headings_has_none():
    stored = state_as_dict(turn(plain(), "one", 2.5))
    for each in stored["objects"].values():
        del each["heading"]
    assert {each.heading for each in state_from_dict(stored).objects.values()} == {0.0}


@pytest.mark.parametrize("heading", ["north", True, None, math.inf, math.nan])
def test_a_heading_that_is_no_angle_is_refused_by_name(heading):
    stored = state_as_dict(plain())
    stored["objects"]["one"]["heading"] = heading
    with pytest.raises(ConfigError, match="heading of 'one'"):
        state_from_dict(stored)


@given(st.floats(-20, 20), st.floats(-20, 20), st.floats(0.001, 0.999))
def test_headings_blend_the_shorter_way_round(first, second, weight):
    a, b = turn(plain(), "one", first), turn(plain(), "one", second)
    way = math.remainder(blend(a, b, weight)["one"].heading - first, math.tau)
    assert abs(way) <= math.pi * weight + 1e-9
    assert blend(a, b, 1.0)["one"].heading == second
    assert blend(a, b, 0.0)["one"].heading == first
