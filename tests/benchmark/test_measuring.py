"""Numbers, points, films and variations: what a benchmark is made of."""

import dataclasses

import numpy as np
import pytest
import tiny_model
import torch

from pe_runtime.benchmark import points as bench_points
from pe_runtime.benchmark.errors import PictureError, picture_error, pooled
from pe_runtime.benchmark.machine import describe_machine, peak_memory, product_rate
from pe_runtime.benchmark.motion import FILMS, film
from pe_runtime.benchmark.points import all_points
from pe_runtime.benchmark.scenes import open_scene, store_scene
from pe_runtime.benchmark.timing import interleaved, log_slope, spread
from pe_runtime.benchmark.variations import resized, with_cast, with_samples
from pe_runtime.config import QUALITIES, Quality
from pe_runtime.contract.errors import ConfigError, ShotError
from pe_runtime.environment import PlayableEnvironment, RenderOptions


@pytest.fixture(scope="module")
def model(tmp_path_factory):
    return tiny_model.write_model(tmp_path_factory.mktemp("model") / "tiny.safetensors")


@pytest.fixture(scope="module")
def scene(model):
    return open_scene(model, None, "cpu")


def drawn(scene):
    """One frame of an environment that remembers nothing."""
    own = scene.environment
    fresh = PlayableEnvironment(own.config, own.networks, {}, {})
    return fresh.render(scene.state, scene.camera)


def test_the_middle_of_measurements_ignores_one_slow_run():
    found = spread([2.0, 1.0, 900.0, 3.0, 4.0])
    assert (found.low, found.median, found.high, found.count) == (2.0, 3.0, 4.0, 5)
    assert spread([7.0]).median == spread([7.0]).high == 7.0


def test_every_round_has_everything_and_begins_one_further_on():
    assert interleaved("abc", 4) == list("abcbcacababc")
    assert interleaved("a", 2) == ["a", "a"]
    assert interleaved("", 2) == interleaved("ab", 0) == []


def test_the_slope_is_the_exponent():
    x = [1.0, 2.0, 5.0, 9.0]
    assert log_slope(x, [3.0 * each**0.9 for each in x]) == pytest.approx(0.9)


def test_errors_of_a_picture_are_what_their_names_say():
    truth = np.full((8, 8, 3), 0.5)
    picture = truth.copy()
    picture[2, 3, 1] += 0.25
    error = picture_error(picture, truth)
    assert error.max_abs == pytest.approx(0.25)
    assert error.rmse == pytest.approx(0.25 / np.sqrt(192))
    assert error.psnr == pytest.approx(-20 * np.log10(error.rmse))
    assert error.perceptual > 0
    assert picture_error(truth, truth) == PictureError(0.0, 0.0, None, 0.0)


def test_small_errors_are_not_lost_in_float32():
    truth = np.full((8, 8, 3), 0.5)
    shifted = truth + np.linspace(0, 1e-9, 192).reshape(8, 8, 3)
    assert 0 < picture_error(shifted, truth).perceptual < 1e-8
    assert picture_error(shifted, truth).psnr > 180


def test_pooled_errors_keep_the_worst_pixel_and_the_mean_square():
    both = pooled([PictureError(0.5, 0.3, 10.0, 0.2), PictureError(0.1, 0.4, 8.0, 0.4)])
    assert both.max_abs == 0.5
    assert both.rmse == pytest.approx(np.sqrt((0.09 + 0.16) / 2))
    assert both.perceptual == pytest.approx(0.3)
    assert pooled([PictureError(0.0, 0.0, None, 0.0)]).psnr is None


def test_points_are_every_preset_and_every_switch_alone():
    points = all_points()
    assert [p.name for p in points if p.kind == "preset"] == list(QUALITIES)
    for field in dataclasses.fields(Quality):
        own = [p for p in points if p.kind == "switch" and p.name.startswith(field.name)]
        assert own, field.name
        for point in own:
            changed = dataclasses.replace(point.quality, **{field.name: field.default})
            assert changed == Quality() != point.quality
    names = [point.name for point in points]
    assert len(set(names)) == len(names)


def test_each_value_that_a_preset_gives_a_switch_is_a_point():
    presets = {"a": Quality(), "b": Quality(termination=0.25), "c": Quality(termination=0.5)}
    switches = [p.name for p in all_points(presets) if p.name.startswith("termination")]
    assert switches == ["termination 0.25", "termination 0.5"]


def test_a_new_switch_appears_by_itself(monkeypatch):
    @dataclasses.dataclass(frozen=True)
    class Later(Quality):
        halves: float = 1.0
        skips: bool = False

    monkeypatch.setattr(bench_points, "Quality", Later)
    names = [p.name for p in all_points({"exact": Later()})]
    assert {"halves 0.5", "skips"} <= set(names)


def test_without_switches_the_baseline_and_presets_are_left():
    assert [p.name for p in all_points(switches=False)] == ["plain", *QUALITIES]


def test_only_the_baseline_is_drawn_plainly():
    assert [p.name for p in all_points() if p.plain] == ["plain"]


def test_the_machine_is_described_with_the_rate_of_a_product():
    machine = describe_machine("cpu", rows=64)
    assert machine.processor and machine.cores >= 1
    assert machine.threads == torch.get_num_threads()
    assert min(machine.gflops_float32, machine.gflops_bfloat16) >= 0
    assert product_rate(torch.float32, "cpu", 64) > 0


def test_peak_memory_only_grows_and_sees_what_was_allocated():
    before = peak_memory()
    if before is None:
        pytest.skip("no /proc on this machine")
    held = np.ones(64 << 20, np.uint8)
    assert peak_memory() >= before
    assert peak_memory() > held.nbytes / (1 << 20)


def test_films_begin_with_the_scene_and_change_what_they_say(scene):
    for kind in FILMS:
        (state, camera), *_, (later, there) = film(scene, kind, 3)
        assert camera == scene.camera
        walked = {n for n in state.objects if not torch.equal(state[n].position, later[n].position)}
        posed = {n for n in state.objects if not torch.equal(state[n].pose, later[n].pose)}
        players = set(scene.environment.playable_names)
        assert walked == posed == (set() if kind == "still" else players)
        assert (there == camera) == (kind != "moving")
        for name, each in scene.state.objects.items():
            assert torch.equal(each.position, state[name].position)


def test_a_moving_camera_does_not_depend_on_who_is_there(scene):
    crowd = with_cast(scene, "out of view", 3)
    for frame in (0, 2):
        assert FILMS["moving"](scene, frame)[1] == FILMS["moving"](crowd, frame)[1]


def test_a_stored_scene_comes_back_to_the_bit(scene, model, tmp_path):
    store_scene(scene, tmp_path / "start.json")
    again = open_scene(model, tmp_path / "start.json", "cpu")
    assert again.camera == scene.camera
    for name, each in scene.state.objects.items():
        own = again.state[name]
        assert torch.equal(own.position, each.position) and torch.equal(own.style, each.style)
        assert torch.equal(own.pose, each.pose)
    with pytest.raises(ShotError):
        open_scene(model, tmp_path / "nothing.json", "cpu")


def test_players_out_of_view_hidden_or_absent_change_no_pixel(scene):
    found = drawn(scene).rgb
    for cast in ("out of view", "more hidden"):
        crowd = with_cast(scene, cast, 3)
        assert len(crowd.environment.playable_names) == 5
        np.testing.assert_array_equal(drawn(crowd).rgb, found)
    nobody, hidden = (drawn(with_cast(scene, cast, 0)).rgb for cast in ("absent", "hidden"))
    np.testing.assert_array_equal(nobody, hidden)
    assert np.abs(hidden - found).max() > 1e-4


def test_more_players_in_view_are_seen(scene):
    crowd = with_cast(scene, "in view", 4)
    masks = crowd.environment.playable_names
    frame = crowd.environment.render(crowd.state, crowd.camera, RenderOptions(masks=masks))
    assert all(frame.masks[name].max() > 0 for name in masks)


def test_an_unknown_cast_and_company_for_nobody_are_refused(scene):
    with pytest.raises(ConfigError, match="no cast 'crowd'"):
        with_cast(scene, "crowd", 1)
    with pytest.raises(ConfigError):
        with_cast(with_cast(scene, "absent", 0), "in view", 1)


def test_factors_of_samples_and_sizes_arrive_at_the_renderer(scene):
    finer = with_samples(scene, 2.0)
    counts = [drawn(each).statistics["field_samples"] for each in (scene, finer)]
    assert counts[1] == 2 * counts[0]
    assert with_samples(scene, 0.01).environment.config.classes["player"].samples == 1
    assert drawn(resized(scene, 20, 12)).rgb.shape == (12, 20, 3)
