"""Keys become pictures, and the pictures become the same keys again."""

import threading

import numpy as np
import pytest
from addon.stage import BOXES, HEIGHT, WIDTH, front_camera

from blender_addon.playing.clip_actions import (
    ClipFrame,
    PictureFeed,
    read_actions,
    step_frames,
)
from blender_addon.worker.replies import WorkerCancelledError
from pe_runtime.contract.camera import project
from pe_runtime.contract.errors import ShotError

NAMES = ["player_1"]


class Walker:
    """Encodes the left edge of a box as a place and says how far it went."""

    def __init__(self):
        self.inferred = None

    def detect(self, pixels, should_stop):
        return {"player_1": (float(pixels[0, 0, 0]), 0.0, 9.0, 9.0)} if pixels[0, 0, 0] else {}

    def encode(self, seen, boxes, should_stop):
        x = boxes["player_1"][0] if "player_1" in boxes else -1.0
        return {"objects": {"player_1": {"position": [x, 0.0, 0.0], "style": [x]}}}

    def infer(self, states, cameras, should_stop):
        places = [each["objects"]["player_1"]["position"][0] for each in states]
        self.inferred = states
        return {"player_1": np.diff(places).astype(int).tolist()}


def pictures(values, boxed=False):
    for frame, value in enumerate(values, start=1):
        boxes = {"player_1": (value, 0.0, 9.0, 9.0)} if boxed else None
        yield ClipFrame(frame, np.full((2, 2, 3), value, np.uint8), front_camera(), boxes)


def read(values, observer=None, boxed=False, stop=lambda: False):
    observer = observer or Walker()
    return read_actions(
        pictures(values, boxed), NAMES, observer, stop, lambda *_: None, len(values)
    )


@pytest.mark.parametrize("boxed", [True, False], ids=["tracked", "detected"])
def test_keys_stand_only_where_the_action_changes(boxed):
    found = read([1, 2, 3, 5, 7, 8], boxed=boxed)
    assert found.keys == {"player_1": [(1, 1), (3, 2), (5, 1)]}
    assert found.filled == {}


def test_who_is_missed_once_stands_between_its_neighbours():
    observer = Walker()
    found = read([10, 12, 0, 16, 18, 20], observer)
    assert found.keys == {"player_1": [(1, 2)]}
    assert found.filled == {"player_1": 1}
    assert observer.inferred[2]["objects"]["player_1"]["style"] in ([12.0], [16.0])


def test_who_is_hardly_ever_seen_is_refused():
    with pytest.raises(ShotError, match="'player_1' is seen in 2 of 4 pictures only"):
        read([1, 0, 0, 4])


def test_one_picture_shows_no_action():
    with pytest.raises(ShotError, match="no whole step"):
        read([1])


def test_esc_ends_the_reading():
    with pytest.raises(WorkerCancelledError):
        read([1, 2, 3], stop=lambda: True)


def test_steps_lie_where_the_worker_takes_them():
    assert step_frames(1, 11, 2.0) == [1, 3, 5, 7, 9, 11]
    assert step_frames(1, 11, 4.8) == [1, 5, 10]
    assert step_frames(1, 10, 4.8) == [1, 5]
    assert step_frames(5, 5, 2.0) == [5]


class TestFeed:
    def test_pictures_cross_threads_in_order(self):
        feed, got = PictureFeed(), []
        thread = threading.Thread(target=lambda: got.extend(feed.pictures(lambda: False)))
        thread.start()
        for each in pictures([1, 2, 3, 4, 5]):
            feed.give(each)
        feed.give(None)
        thread.join(60)
        assert [each.frame for each in got] == [1, 2, 3, 4, 5]

    def test_it_fills_up_and_says_so(self):
        feed = PictureFeed()
        for each in pictures([1, 2]):
            assert feed.has_room
            feed.give(each)
        assert not feed.has_room

    def test_why_a_picture_cannot_be_read_arrives(self):
        feed = PictureFeed()
        feed.give(ShotError("the tape is torn"))
        with pytest.raises(ShotError, match="the tape is torn"):
            list(feed.pictures(lambda: False))

    def test_esc_ends_the_waiting(self):
        with pytest.raises(WorkerCancelledError):
            list(PictureFeed().pictures(lambda: True))


class TestInBlender:
    pytestmark = pytest.mark.blender

    KEYS = {
        "player_1": [(1, 1), (5, 3), (9, 2)],
        "player_2": [(1, 0), (7, 2)],
    }

    @pytest.fixture
    def filmed(self, environment, addon, tmp_path):
        """Two players act for twelve frames; the frames lie in a folder, the keys are gone."""
        import bpy

        from blender_addon import playables
        from blender_addon.bake import bake_of
        from blender_addon.fcurves import ACTION_PATH, remove_curves
        from blender_addon.scene_bridge import playable_objects
        from pe_runtime.images import write_png

        environment.frame_end = 13
        for name, keys in self.KEYS.items():
            for frame, action in keys:
                playables.key_action(playable_objects(environment)[name], frame, action)
        bpy.ops.playable.bake_paths()
        bake = bake_of(environment.playable_environment)
        for frame in bake.shot.frames:
            write_png(tmp_path / f"clip_{frame:04d}.png", addon.render(bake.shot, frame).rgb)
        for each in playable_objects(environment).values():
            remove_curves(each, ACTION_PATH)
        return bake, tmp_path

    @pytest.fixture
    def clip(self, environment, filmed):
        """The frames as a movie clip with two tracks at the feet and heads of either player."""
        import bpy

        bake, folder = filmed
        clip = bpy.data.movieclips.load(str(folder / "clip_0001.png"))
        framing = environment.playable_environment.framing
        framing.clip = clip
        for name in BOXES:
            framing.tracked[name].tracks = f"{name} "
            low = clip.tracking.tracks.new(name=f"{name} foot", frame=1)
            high = clip.tracking.tracks.new(name=f"{name} head", frame=1)
            for frame, place in zip(bake.shot.frames, bake.paths[name], strict=True):
                (u, v), _ = (each[0] for each in project(bake.shot.camera_at(frame), place[None]))
                for track, x, y in ((low, u - 1, v), (high, u + 1, v - 9)):
                    marker = track.markers.insert_frame(frame)
                    marker.co = x / WIDTH, 1 - y / HEIGHT
        return clip

    def strip_of(self, scene, folder):
        strips = scene.sequence_editor_create().strips
        strip = strips.new_image("clip", str(folder / "clip_0001.png"), channel=3, frame_start=1)
        for frame in range(2, 14):
            strip.elements.append(f"clip_{frame:04d}.png")
        if "duration" in strip.bl_rna.properties:
            strip.duration = 13
        else:
            strip.frame_final_duration = 13
        return strip

    def keys(self, scene):
        from blender_addon.fcurves import ACTION_PATH, curves_of
        from blender_addon.scene_bridge import playable_objects

        found = {}
        for name, each in playable_objects(scene).items():
            points = curves_of(each).find(ACTION_PATH).keyframe_points
            assert {point.interpolation for point in points} == {"CONSTANT"}
            found[name] = [(int(point.co[0]), int(point.co[1])) for point in points]
        return found

    def test_a_movie_clip_gives_back_the_keys_that_it_was_made_from(self, environment, clip):
        import bpy

        assert bpy.ops.playable.actions_from_clip(source="CLIP") == {"FINISHED"}
        assert self.keys(environment) == self.KEYS
        assert len(bpy.data.scenes) == 1

    def test_a_strip_in_another_scene_does_too(self, environment, clip, filmed):
        import bpy

        edit = bpy.data.scenes.new("Edit")
        environment.playable_environment.edit_scene = edit
        self.strip_of(edit, filmed[1])
        bpy.ops.playable.actions_from_clip(source="STRIP")
        assert self.keys(environment) == self.KEYS

    def movie_of(self, folder):
        """A movie of the frames that loses nothing."""
        import bpy

        film = bpy.data.scenes.new("film")
        self.strip_of(film, folder)
        film.frame_start, film.frame_end = 1, 13
        render, film.view_settings.view_transform = film.render, "Standard"
        render.resolution_x, render.resolution_y, render.dither_intensity = WIDTH, HEIGHT, 0.0
        if hasattr(render.image_settings, "media_type"):
            render.image_settings.media_type = "VIDEO"
        render.image_settings.file_format, render.image_settings.color_mode = "FFMPEG", "RGB"
        render.ffmpeg.format, render.ffmpeg.codec = "QUICKTIME", "PNG"
        render.use_file_extension, render.filepath = False, str(folder / "film.mov")
        bpy.ops.render.render(animation=True, scene=film.name)
        bpy.data.scenes.remove(film)
        return folder / "film.mov"

    @pytest.mark.parametrize("kind", ["movie", "pictures"])
    def test_a_clip_is_read_to_the_byte_wherever_it_starts(self, environment, filmed, kind):
        import bpy

        from blender_addon.pictures import read_picture
        from blender_addon.playing.clip_reading import ClipSource

        folder = filmed[1]
        path = self.movie_of(folder) if kind == "movie" else folder / "clip_0001.png"
        clip = bpy.data.movieclips.load(str(path))
        clip.frame_start, clip.frame_offset = 20, 2
        source = ClipSource(environment.name, "", clip.name, None)
        images = len(bpy.data.images)
        for frame, shown in ((20, 3), (25, 8), (28, 11)):
            picture = source.picture_at(frame)
            expected = read_picture(str(folder / f"clip_{shown:04d}.png"))
            assert np.array_equal(picture.pixels, expected)
            assert picture.frame == frame and picture.boxes is None
        assert len(bpy.data.scenes) == 1 and len(bpy.data.images) == images

    def test_keys_outside_of_the_range_stay(self, environment, clip):
        import bpy

        from blender_addon import playables
        from blender_addon.scene_bridge import playable_objects

        target = playable_objects(environment)["player_1"]
        for frame, action in ((2, 4), (30, 5)):
            playables.key_action(target, frame, action)
        bpy.ops.playable.actions_from_clip(source="CLIP")
        assert self.keys(environment)["player_1"] == [*self.KEYS["player_1"], (30, 5)]

    def test_the_read_keys_lead_along_the_same_paths(self, environment, clip, filmed):
        import bpy

        from blender_addon.bake import bake_of

        bpy.ops.playable.actions_from_clip(source="CLIP")
        bpy.ops.playable.bake_paths()
        again = bake_of(environment.playable_environment)
        for name, path in filmed[0].paths.items():
            np.testing.assert_allclose(again.paths[name], path, atol=1e-5)

    @pytest.mark.parametrize(
        ("change", "message"),
        [
            (lambda scene, clip: setattr(scene, "frame_end", 99), "has 13 frames"),
            (lambda scene, clip: setattr(clip, "frame_start", 50), "does not show at frame 1"),
            (lambda scene, clip: setattr(scene, "frame_end", 2), "no whole step"),
            (lambda scene, clip: setattr(scene.render, "resolution_x", 100), "Use Picture Size"),
        ],
    )
    def test_what_cannot_be_read_is_refused_and_no_key_is_lost(
        self, environment, clip, change, message
    ):
        import bpy

        from blender_addon import playables
        from blender_addon.scene_bridge import playable_objects

        for each in playable_objects(environment).values():
            playables.key_action(each, 3, 4)
        change(environment, clip)
        with pytest.raises(RuntimeError, match=message):
            bpy.ops.playable.actions_from_clip(source="CLIP")
        assert self.keys(environment) == dict.fromkeys(BOXES, [(3, 4)])
        assert len(bpy.data.scenes) == 1

    def test_half_named_tracks_and_missing_strips_are_refused(self, environment, clip):
        import bpy

        with pytest.raises(RuntimeError, match="no movie or image strip shows from frame 1 to 13"):
            bpy.ops.playable.actions_from_clip(source="STRIP")
        environment.playable_environment.framing.tracked["player_2"].tracks = ""
        with pytest.raises(RuntimeError, match="'player_2' has no tracks"):
            bpy.ops.playable.actions_from_clip(source="CLIP")
