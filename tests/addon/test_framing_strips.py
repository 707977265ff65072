"""The frame under the sequencer's playhead is the strip's own, to the byte."""

import numpy as np
import pytest

from pe_runtime.images import write_png

bpy = pytest.importorskip("bpy")
from blender_addon.framing import strip_frames  # noqa: E402 - after the check for Blender
from blender_addon.framing.picture_source import find_picture  # noqa: E402
from blender_addon.framing.strip_frames import frame_under_playhead  # noqa: E402
from blender_addon.strips.timing import span  # noqa: E402
from pe_runtime.contract.errors import ShotError  # noqa: E402

pytestmark = pytest.mark.blender
WIDTH, HEIGHT, FRAMES, START = 32, 18, 6, 10


def frame(number):
    shape = (HEIGHT, WIDTH, 3)
    return np.random.default_rng(number).integers(0, 256, shape, dtype=np.uint8)


@pytest.fixture(scope="session")
def files(tmp_path_factory):
    """A folder with six pictures and a movie of them that loses nothing."""
    folder = tmp_path_factory.mktemp("strips")
    for number in range(FRAMES):
        write_png(folder / f"picture_{number}.png", frame(number))
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.data.scenes[0]
    images(scene, folder, start=1)
    scene.frame_start, scene.frame_end, scene.render.fps = 1, FRAMES, 25
    render = scene.render
    render.resolution_x, render.resolution_y, render.dither_intensity = WIDTH, HEIGHT, 0.0
    scene.view_settings.view_transform = "Standard"
    if hasattr(render.image_settings, "media_type"):
        render.image_settings.media_type = "VIDEO"
    render.image_settings.file_format, render.image_settings.color_mode = "FFMPEG", "RGB"
    render.ffmpeg.format, render.ffmpeg.codec = "QUICKTIME", "PNG"
    render.use_file_extension, render.filepath = False, str(folder / "movie.mov")
    bpy.ops.render.render(animation=True)
    return folder


@pytest.fixture
def cut(files, addon):
    """A fresh scene of another size, whose view transform would alter every byte."""
    scene = bpy.data.scenes[0]
    scene.sequence_editor_create()
    scene.render.resolution_x, scene.render.resolution_y = 100, 100
    scene.view_settings.view_transform = "AgX"
    scene.playable_environment.framing.picture_source = "STRIP"
    return scene


def strips_of(scene):
    editor = scene.sequence_editor or scene.sequence_editor_create()
    return editor.strips


def images(scene, folder, channel=1, start=START):
    strip = strips_of(scene).new_image("pictures", str(folder / "picture_0.png"), channel, start)
    for number in range(1, FRAMES):
        strip.elements.append(f"picture_{number}.png")
    return strip


def movie(scene, folder, channel=1, name="movie"):
    return strips_of(scene).new_movie(name, str(folder / "movie.mov"), channel, START)


def shown(scene, at):
    """The number of the picture that is under the playhead at a frame."""
    scene.frame_set(at)
    pixels = frame_under_playhead([scene]).pixels()
    return [number for number in range(FRAMES) if np.array_equal(pixels, frame(number))]


def trim(strip, left, right):
    """Move the handles inwards, in the words of every supported Blender."""
    if "left_handle" in strip.bl_rna.properties:
        strip.left_handle += left
        strip.right_handle -= right
    else:
        strip.frame_offset_start, strip.frame_offset_end = left, right


CHANGES = {
    "plain": (lambda strip: None, [0, 1, 2, 3, 4, 5]),
    "reversed": (lambda strip: setattr(strip, "use_reverse_frames", True), [5, 4, 3, 2, 1, 0]),
    "every second": (lambda strip: setattr(strip, "strobe", 2.0), [0, 0, 2, 2, 4, 4]),
    "faded and flipped": (lambda strip: fade(strip), [0, 1, 2, 3, 4, 5]),
}


def fade(strip):
    strip.blend_alpha, strip.color_saturation, strip.use_flip_x = 0.5, 0.1, True
    strip.transform.scale_x, strip.crop.max_x = 3.0, 4


@pytest.mark.parametrize("make", [images, movie])
@pytest.mark.parametrize("change", CHANGES)
def test_the_frame_under_the_playhead_is_read_to_the_byte(cut, files, make, change):
    apply, expected = CHANGES[change]
    apply(make(cut, files))
    assert [shown(cut, START + index) for index in range(FRAMES)] == [[n] for n in expected]


@pytest.mark.parametrize("make", [images, movie])
def test_trimmed_strips_show_what_is_left(cut, files, make):
    trim(make(cut, files), 2, 1)
    assert shown(cut, START + 2) == [2] and shown(cut, START + 4) == [4]
    with pytest.raises(ShotError, match="no movie or image strip"):
        shown(cut, START + 1)


def test_a_movie_whose_beginning_is_cut_off_starts_later(cut, files):
    strip = movie(cut, files)
    renamed = "content_trim_start" in strip.bl_rna.properties
    setattr(strip, "content_trim_start" if renamed else "animation_offset_start", 2)
    first, _ = span(strip)
    assert [shown(cut, first + index) for index in range(2)] == [[2], [3]]


def test_a_movie_that_is_stretched_in_time_is_rendered_by_blender_itself(cut, files, monkeypatch):
    fade(movie(cut, files))
    covering = images(cut, files, channel=4)
    covering.mute = True
    monkeypatch.setattr(strip_frames, "_frame_of_movie", lambda *_: None)
    scenes = len(bpy.data.scenes)
    assert shown(cut, START + 3) == [3]
    assert len(bpy.data.scenes) == scenes and cut.view_settings.view_transform == "AgX"
    assert covering.mute and not strips_of(cut)["movie"].mute


def test_the_topmost_strip_counts_unless_another_one_is_active(cut, files):
    below, above = movie(cut, files, 1), images(cut, files, 3)
    cut.sequence_editor.active_strip = None
    cut.frame_set(START)
    assert frame_under_playhead([cut]).strip == above
    cut.sequence_editor.active_strip = below
    assert frame_under_playhead([cut]).strip == below
    below.mute = True
    assert frame_under_playhead([cut]).strip == above


def test_a_strip_inside_a_meta_strip_is_found(cut, files):
    meta = strips_of(cut).new_meta("meta", 2, START)
    inner = meta.strips.new_movie("inner", str(files / "movie.mov"), 1, START)
    cut.sequence_editor.active_strip = None
    if "right_handle" in meta.bl_rna.properties:
        meta.right_handle = START + FRAMES
    else:
        meta.frame_final_end = START + FRAMES
    cut.frame_set(START + 2)
    assert frame_under_playhead([cut]).strip == inner
    assert shown(cut, START + 2) == [2]


def test_the_first_scene_with_a_strip_under_its_own_playhead_counts(cut, files):
    other = bpy.data.scenes.new("edit")
    movie(other, files)
    cut.frame_set(1)
    other.frame_set(START + 4)
    found = frame_under_playhead([cut, other])
    assert (found.scene, found.frame) == (other, START + 4)


def test_no_strip_no_sequencer_and_a_gone_movie_are_said(cut, files):
    with pytest.raises(ShotError, match="no movie or image strip is under the playhead in 'Scene'"):
        frame_under_playhead([cut])
    with pytest.raises(ShotError, match="no sequencer"):
        frame_under_playhead([bpy.data.scenes.new("bare")])
    movie(cut, files).filepath = "/nowhere.mov"
    cut.frame_set(START)
    with pytest.raises(ShotError, match="is gone"):
        frame_under_playhead([cut]).pixels()


def test_a_frame_of_a_movie_is_kept_beside_the_file_and_an_image_stays_where_it_is(
    cut, files, tmp_path
):
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "film.blend"))
    scene = bpy.data.scenes[0]
    movie(scene, files)
    scene.frame_set(START + 1)
    kept = find_picture(scene, [scene]).keep()
    assert kept.path.startswith(str(tmp_path / "playable" / "movie_0011_"))
    assert np.array_equal(find_picture(scene, [], kept.path).pixels, frame(1))
    images(scene, files, channel=2)
    scene.sequence_editor.active_strip = None
    assert find_picture(scene, [scene]).path == str(files / "picture_1.png")


def test_reading_a_frame_leaves_nothing_in_the_file(cut, files):
    movie(cut, files)
    before = [len(bpy.data.images), len(bpy.data.textures), len(bpy.data.scenes)]
    shown(cut, START)
    assert [len(bpy.data.images), len(bpy.data.textures), len(bpy.data.scenes)] == before
