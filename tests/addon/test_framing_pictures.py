"""Where pictures come from: files, Images, and where they are kept that are no files."""

import json

import numpy as np
import pytest
from addon.stage import BOXES, HEIGHT, WIDTH, picture_of, read_png

bpy = pytest.importorskip("bpy")
from blender_addon.framing import picture_source  # noqa: E402 - after the check for Blender
from blender_addon.framing.picture_source import find_picture  # noqa: E402
from blender_addon.pictures import png_bytes, read_picture, write_picture  # noqa: E402
from pe_runtime.contract.errors import ShotError  # noqa: E402

pytestmark = pytest.mark.blender


@pytest.fixture
def framing(addon, tmp_path, monkeypatch):
    monkeypatch.setattr(picture_source, "UNSAVED_FOLDER", tmp_path / "unsaved")
    return bpy.data.scenes[0].playable_environment.framing


def painted(name="painted", is_float=False):
    image = bpy.data.images.new(name, WIDTH, HEIGHT, float_buffer=is_float)
    values = np.ones((HEIGHT, WIDTH, 4), np.float32)
    values[..., :3] = picture_of()[::-1] / 255
    if is_float:
        rgb = values[..., :3].astype(np.float64)
        values[..., :3] = np.where(rgb <= 0.04045, rgb / 12.92, ((rgb + 0.055) / 1.055) ** 2.4)
    image.pixels.foreach_set(values.ravel())
    return image


def found():
    return find_picture(bpy.data.scenes[0], [])


def test_a_png_written_by_hand_is_what_other_programs_read(tmp_path):
    write_picture(tmp_path / "new" / "picture.png", picture_of())
    assert np.array_equal(read_png(tmp_path / "new" / "picture.png"), picture_of())
    assert np.array_equal(read_picture(str(tmp_path / "new" / "picture.png")), picture_of())
    assert png_bytes(picture_of()) == png_bytes(picture_of().copy())


def test_a_picture_that_cannot_be_written_leaves_no_half_file(tmp_path, monkeypatch):
    def refuse(self, target):
        raise OSError("full")

    monkeypatch.setattr("pathlib.Path.replace", refuse)
    with pytest.raises(OSError, match="full"):
        write_picture(tmp_path / "picture.png", picture_of())
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("is_float", [False, True])
def test_painted_pixels_are_read_and_kept_to_the_byte(framing, is_float):
    framing.picture_source, framing.image = "IMAGE", painted(is_float=is_float)
    picture = found()
    assert np.array_equal(picture.pixels, picture_of()) and not picture.is_file
    kept = picture.keep()
    assert np.array_equal(read_png(kept.path), picture_of())
    assert "not saved yet" in kept.note and kept.path.endswith(".png")


def test_an_image_that_is_its_file_stays_there(framing, picture):
    framing.picture_source, framing.image = "IMAGE", bpy.data.images.load(str(picture))
    assert found().path == str(picture) and found().keep().note == ""


def test_a_changed_and_a_packed_image_are_not_taken_for_their_file(framing, picture):
    image = bpy.data.images.load(str(picture))
    framing.picture_source, framing.image = "IMAGE", image
    image.pack()
    assert found().path != str(picture)
    image.unpack(method="REMOVE")
    pixels = np.array(image.pixels[:])
    pixels[:3] = 1.0
    image.pixels.foreach_set(pixels.astype(np.float32))
    assert found().pixels[-1, 0].tolist() == [255, 255, 255]
    assert found().path != str(picture)


def test_pictures_are_kept_beside_a_saved_file_and_equal_ones_once(framing, tmp_path):
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "film.blend"))
    framing = bpy.data.scenes[0].playable_environment.framing
    framing.picture_source, framing.image = "IMAGE", painted("my: picture/1.png")
    first, again = found().keep(), found().keep()
    assert first.path == again.path and first.note == ""
    assert [str(each) for each in (tmp_path / "playable").iterdir()] == [first.path]
    framing.image.pixels[0] = 0.5
    assert found().keep().path != first.path


def test_where_nothing_can_be_written_beside_the_file_the_note_says_where_it_is(framing, tmp_path):
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "film.blend"))
    (tmp_path / "playable").write_text("a file where the folder would be")
    framing = bpy.data.scenes[0].playable_environment.framing
    framing.picture_source, framing.image = "IMAGE", painted()
    kept = found().keep()
    assert kept.path.startswith(str(tmp_path / "unsaved")) and "kept in" in kept.note
    assert np.array_equal(read_png(kept.path), picture_of())


def test_what_is_no_single_picture_is_refused_with_what_to_do(framing, picture):
    with pytest.raises(ShotError, match="no picture is chosen"):
        found()
    framing.picture_source = "IMAGE"
    with pytest.raises(ShotError, match="no Image is chosen"):
        found()
    framing.image = bpy.data.images.load(str(picture))
    framing.image.source = "SEQUENCE"
    with pytest.raises(ShotError, match="put it into the sequencer"):
        found()
    framing.image = bpy.data.images.get("Render Result") or bpy.data.images.new("empty", 1, 1)
    framing.picture_source = "FILE"
    bpy.data.scenes[0].playable_environment.image_path = "/nowhere.png"
    with pytest.raises(ShotError, match="there is no picture '/nowhere.png'"):
        found()


def test_an_environment_can_be_made_from_painted_pixels(scene, tmp_path):
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "film.blend"))
    scene = bpy.data.scenes[0]
    settings = scene.playable_environment
    settings.framing.picture_source, settings.framing.image = "IMAGE", painted()
    bpy.ops.playable.new_environment(model="fake", boxes=json.dumps(BOXES))
    assert settings.image_path.startswith("//playable")
    path = bpy.path.abspath(settings.image_path)
    assert np.array_equal(read_png(path), picture_of())
    shown = [each.image for each in scene.camera.data.background_images]
    assert shown == [settings.framing.image] and scene.camera.data.show_background_images


def test_choosing_a_file_shows_it_behind_the_camera_and_tells_its_size(
    environment, picture, tmp_path
):
    settings = environment.playable_environment
    write_picture(tmp_path / "other.png", picture_of(80, 45))
    assert not settings.framing.is_open
    settings.image_path = str(tmp_path / "other.png")
    assert settings.framing.is_open and tuple(settings.framing.backdrop.size) == (80, 45)
    shown = [each.image for each in environment.camera.data.background_images]
    assert shown == [settings.framing.backdrop]
    settings.image_path = "/nowhere.png"
    assert settings.framing.backdrop is None
    settings.image_path = str(picture)
    bpy.ops.playable.show_picture()
    assert len(environment.camera.data.background_images) == 1
