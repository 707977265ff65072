import numpy as np
import pytest
from small_world import box_of, camera, look_at, picture_of, small_config, small_environment

from pe_runtime.config import EncoderConfig
from pe_runtime.contract.errors import CameraError, ConfigError
from pe_runtime.state import state_as_dict, state_from_dict

VIEW = camera()
PLACES = {"player_1": (-0.7, 0.1, 0.0), "player_2": (0.8, -0.2, 0.0)}


def picture(view=VIEW):
    return picture_of(PLACES.values(), view, [0.9, 0.1])


def boxes():
    return {name: box_of(place, VIEW) for name, place in PLACES.items()}


@pytest.fixture(scope="module")
def env():
    return small_environment()


@pytest.fixture(scope="module")
def state(env):
    return env.encode(picture(), VIEW, boxes())


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_a_picture_with_nan_pixels_says_how_many(env, bad):
    broken = picture()
    broken[3, 4, 1] = broken[5, 6, 0] = bad
    with pytest.raises(ConfigError, match="2 pixels that are NaN"):
        env.encode(broken, VIEW, boxes())


@pytest.mark.parametrize("shape", [(16, 32), (16, 32, 4), (16, 32, 1), (0, 32, 3)])
def test_something_that_is_no_picture_is_refused(env, shape):
    with pytest.raises(ConfigError, match="height, width, 3"):
        env.encode(np.zeros(shape, np.float32), VIEW, boxes())


def test_a_picture_of_another_size_than_its_camera_is_refused(env):
    with pytest.raises(ConfigError, match="32x15 pixels, its camera 32x16"):
        env.encode(picture()[:15], VIEW, boxes())


@pytest.mark.parametrize("name", ["player_3", "ground"])
def test_a_box_for_something_that_is_not_playable_is_refused(env, name):
    with pytest.raises(ConfigError, match=f"'{name}'.*player_1, player_2"):
        env.encode(picture(), VIEW, {name: (1.0, 2.0, 3.0, 4.0)})


@pytest.mark.parametrize(
    "box", [(5.0, 4.0, 5.0, 9.0), (5.0, 9.0, 8.0, 9.0), (8.0, 4.0, 5.0, 9.0), (np.nan,) * 4]
)
def test_a_box_without_area_is_an_error_and_not_a_position(env, box):
    with pytest.raises(CameraError, match="'player_1' has no area"):
        env.encode(picture(), VIEW, {"player_1": box})


def test_a_foot_above_the_horizon_is_an_error_and_not_a_position(env):
    level = look_at((0.0, -5.0, 1.0), (0.0, 0.0, 1.0))
    with pytest.raises(CameraError, match="'player_2'.*horizon"):
        env.encode(picture(level), level, {"player_2": (5.0, 1.0, 9.0, 7.0)})


@pytest.mark.parametrize("box", [(40.0, 8.0, 45.0, 12.0), (-9.0, 8.0, -1.0, 12.0)])
def test_a_box_beside_the_picture_is_an_error_where_the_box_is_what_is_cut_out(box):
    encoder = EncoderConfig(crop="box", height=16, width=16, channels=(4, 8), hidden=8)
    env = small_environment(small_config(encoder=encoder))
    with pytest.raises(CameraError, match="'player_1'.*outside the picture of 32x16"):
        env.encode(picture(), VIEW, {"player_1": box})


def test_a_player_at_the_camera_s_own_feet_is_an_error_and_not_a_position(env):
    down = look_at((0.0, -0.5, 0.8), (0.0, 0.2, 0.0))
    with pytest.raises(CameraError, match="'player_1'.*behind the camera"):
        env.encode(picture(), down, {"player_1": (10.0, 2.0, 20.0, 15.0)})


def test_a_picture_of_bytes_is_refused_and_told_how_to_be_converted(env):
    with pytest.raises(ConfigError, match="Divide 8-bit values by 255"):
        env.encode((picture() * 255).astype(np.uint8), VIEW, boxes())
    with pytest.raises(ConfigError, match=r"in \[0, 1\]"):
        env.encode(picture() * 3, VIEW, boxes())


@pytest.mark.parametrize("verb", ["render", "step"])
def test_a_state_of_another_model_is_refused(env, state, verb):
    stranger = state_as_dict(state)
    stranger["objects"]["player_1"]["style"].append(0.0)
    with pytest.raises(ConfigError, match="from another model"):
        _use(env, verb, state_from_dict(stranger))
    del stranger["objects"]["player_1"]
    with pytest.raises(ConfigError, match="hide objects instead"):
        _use(env, verb, state_from_dict(stranger))


def _use(env, verb, state):
    return env.render(state, VIEW) if verb == "render" else env.step(state, {}, VIEW)


@pytest.mark.parametrize(("states", "cameras"), [(0, 0), (2, 1), (1, 2)])
def test_actions_are_only_inferred_from_as_many_cameras_as_states(env, state, states, cameras):
    with pytest.raises(ConfigError, match="one camera per state"):
        env.infer_actions([state] * states, [VIEW] * cameras)
