"""The colour contract: the worker's bytes arrive unchanged wherever the format can hold them."""

import numpy as np
import OpenImageIO as oiio  # noqa: N813 its own documentation's name
import pytest
from addon.stage import read_png

bpy = pytest.importorskip("bpy")
pytestmark = pytest.mark.blender

from blender_addon import playables  # noqa: E402
from blender_addon.bake import Output, bake_of, take_as_baked  # noqa: E402
from blender_addon.filming.pixels import use_exact_colours  # noqa: E402
from blender_addon.scene_bridge import playable_objects  # noqa: E402

FRAMES = range(1, 5)


@pytest.fixture
def film(environment):
    """A baked environment whose pictures hold every byte there is."""
    environment.render.resolution_x = environment.render.resolution_y = 256
    playables.key_action(playable_objects(environment)["player_1"], 1, 1)
    bpy.ops.playable.bake_paths()
    return environment


@pytest.fixture
def sent(film, addon):
    """Per frame the bytes that the worker sends, (height, width, 3)."""
    bake = bake_of(film.playable_environment)
    takes = {frame: take_as_baked(bake, frame, Output(256, 256)) for frame in FRAMES}
    found = {frame: addon.render(take, frame, whole=bake.shot).rgb for frame, take in takes.items()}
    assert all(len(np.unique(rgb)) == 256 for rgb in found.values())
    return found


def save_as(render, path, file_format, **settings):
    """Let a scene's renders be written in this format."""
    output = render.image_settings
    if hasattr(output, "media_type"):
        output.media_type = "VIDEO" if file_format == "FFMPEG" else "IMAGE"
    output.file_format = file_format
    for name, value in {"color_mode": "RGB", **settings}.items():
        setattr(output, name, value)
    render.filepath, render.use_file_extension = str(path), True


@pytest.fixture
def cut(film):
    """An Edit scene, and a function that reads what its sequencer shows at a frame."""
    edit = bpy.data.scenes.new("cut")
    edit.sequence_editor_create()
    edit.render.engine = "BLENDER_WORKBENCH"
    edit.render.resolution_x = edit.render.resolution_y = 256
    use_exact_colours(edit)

    def shown(frame, folder):
        edit.frame_start = edit.frame_end = frame
        save_as(edit.render, folder / "cut_####", "PNG")
        bpy.ops.render.render(animation=True, scene=edit.name)
        return read_png(folder / f"cut_{frame:04d}.png")

    yield edit, shown
    bpy.ops.wm.read_factory_settings(use_empty=True)


@pytest.mark.parametrize("file_format", ["PNG", "BMP", "TIFF", "TARGA"])
def test_a_still_holds_the_bytes_that_were_sent(film, sent, tmp_path, file_format):
    save_as(film.render, tmp_path / "still", file_format)
    film.frame_set(3)
    bpy.ops.render.render(write_still=True)
    (file,) = tmp_path.glob("still.*")
    assert np.array_equal(read_png(file), sent[3])


def test_an_animation_holds_the_bytes_that_were_sent(film, sent, tmp_path):
    save_as(film.render, tmp_path / "f_####", "PNG")
    bpy.ops.render.render(animation=True)
    for frame in FRAMES:
        assert np.array_equal(read_png(tmp_path / f"f_{frame:04d}.png"), sent[frame])


def test_sixteen_bits_hold_the_bytes_to_a_hundredth_of_one(film, sent, tmp_path):
    save_as(film.render, tmp_path / "deep", "PNG", color_depth="16")
    film.frame_set(2)
    bpy.ops.render.render(write_still=True)
    (file,) = tmp_path.glob("deep.*")
    deep = np.asarray(oiio.ImageInput.open(str(file)).read_image(oiio.UINT16))[..., :3]
    assert np.abs(deep / 257 - sent[2]).max() < 0.01


def test_a_32_bit_exr_holds_the_bytes_as_linear_light(film, sent, tmp_path):
    save_as(film.render, tmp_path / "linear", "OPEN_EXR", color_depth="32")
    film.frame_set(2)
    bpy.ops.render.render(write_still=True)
    (file,) = tmp_path.glob("linear.*")
    linear = np.asarray(oiio.ImageInput.open(str(file)).read_image(oiio.FLOAT))[..., :3]
    light = linear.astype(np.float64)
    encoded = np.where(light <= 0.0031308, light * 12.92, 1.055 * light ** (1 / 2.4) - 0.055)
    assert np.abs(encoded * 255 - sent[2]).max() < 1e-4


def test_the_strip_of_the_sequencer_holds_the_bytes_that_were_sent(film, sent, cut, tmp_path):
    save_as(film.render, tmp_path / "f_####", "PNG")
    bpy.ops.render.render(animation=True)
    edit, shown = cut
    strip = edit.sequence_editor.strips.new_image(
        "film", str(tmp_path / "f_0001.png"), channel=1, frame_start=1, fit_method="ORIGINAL"
    )
    for frame in FRAMES[1:]:
        strip.elements.append(f"f_{frame:04d}.png")
    for frame in (1, 4):
        assert np.array_equal(shown(frame, tmp_path), sent[frame])


def test_a_scene_strip_asks_the_engine_and_holds_its_bytes(film, sent, cut, tmp_path):
    edit, shown = cut
    edit.sequence_editor.strips.new_scene("live", film, channel=1, frame_start=1)
    assert np.array_equal(shown(2, tmp_path), sent[2])


def test_a_lossless_movie_holds_the_bytes_that_were_sent(film, sent, cut, tmp_path):
    save_as(film.render, tmp_path / "film_", "FFMPEG")
    film.render.ffmpeg.format, film.render.ffmpeg.codec = "MKV", "FFV1"
    bpy.ops.render.render(animation=True)
    (movie,) = tmp_path.glob("film_*")
    edit, shown = cut
    edit.render.fps = film.render.fps
    edit.sequence_editor.strips.new_movie(
        "film", str(movie), channel=1, frame_start=1, fit_method="ORIGINAL"
    )
    for frame in (1, 4):
        assert np.array_equal(shown(frame, tmp_path), sent[frame])
