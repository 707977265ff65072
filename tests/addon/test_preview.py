"""The viewport's pictures, through a worker: at rest, baked, never in anybody's way."""

import dataclasses
import time
from types import SimpleNamespace

import numpy as np
import pytest
from addon.stage import faulty, front_camera

bpy = pytest.importorskip("bpy")
from blender_addon import playables  # noqa: E402 - after the check for Blender
from blender_addon.bake import bake_of  # noqa: E402
from blender_addon.preview.desk import Desk  # noqa: E402
from blender_addon.preview.drawing_thread import STOPPED_MESSAGE, Drawer  # noqa: E402
from blender_addon.preview.subject import read_subject  # noqa: E402
from blender_addon.preview.view_camera import PERSPECTIVE_NEEDED  # noqa: E402
from blender_addon.preview.viewport import COVERED_MESSAGE, Viewport  # noqa: E402
from blender_addon.scene_bridge import playable_objects, read_moment  # noqa: E402
from pe_runtime.contract.errors import ShotError  # noqa: E402

pytestmark = pytest.mark.blender
VIEW = front_camera(96, 54)
MINUTE = 60.0


def subject_of(scene, frame=None):
    if frame is not None:
        scene.frame_set(frame)
    scene.view_layers[0].update()
    return read_subject(scene.view_layers[0].depsgraph)


def wait_for(condition):
    deadline = time.monotonic() + MINUTE
    while not condition():
        assert time.monotonic() < deadline, "it did not come"
        time.sleep(0.01)


def finished(drawer, desk):
    """Have a desk's drawer go on, as the timer does, until all is on show."""

    def done():
        drawer.go_on()
        return not desk.has_more and not drawer.works

    wait_for(done)
    return desk.shown.rgb


def previewed(addon, subject, view=VIEW):
    desk = Desk()
    desk.want(subject.seen_by(view))
    return finished(Drawer(desk, addon), desk)


def drawn(addon, subject, view=VIEW):
    wish = subject.seen_by(view)
    return addon.render(wish.take, wish.take.frame_start, whole=wish.whole).rgb


def test_before_anything_is_baked_the_encoded_state_is_shown_where_the_empties_stand(
    environment, addon
):
    at_rest = subject_of(environment)
    assert at_rest.take.objects == subject_of(environment, 3).take.objects
    assert all(track.locations is None for track in at_rest.take.objects)
    assert at_rest.take.quality == "draft" and at_rest.take.passes == ()
    picture = previewed(addon, at_rest)
    assert np.array_equal(picture, drawn(addon, at_rest))
    playable_objects(environment)["player_1"].location.x += 1.0
    moved = subject_of(environment)
    assert moved.whole is at_rest.whole
    assert [track.locations is None for track in moved.take.objects] == [False, True]
    assert not np.array_equal(previewed(addon, moved), picture)


def test_after_baking_the_frame_is_shown_that_a_render_would_show(environment, addon):
    playables.key_action(playable_objects(environment)["player_1"], 1, 2)
    bpy.ops.playable.bake_paths()
    bake = bake_of(environment.playable_environment)
    for frame in (1, 3):
        subject = subject_of(environment, frame)
        assert subject.whole is bake.shot and subject.take.frame_start == frame
        depsgraph = environment.view_layers[0].depsgraph
        eye = read_moment(depsgraph).camera
        picture = previewed(addon, subject, eye)
        take = dataclasses.replace(
            bake.shot, frame_start=frame, frame_end=frame, cameras=(eye,), quality="draft"
        )
        assert np.array_equal(picture, addon.render(take, frame, whole=bake.shot).rgb)


def test_beyond_the_bake_and_after_other_keys_the_empties_are_followed(environment, addon):
    bpy.ops.playable.bake_paths()
    after = subject_of(environment, 50)
    assert after.take.frame_start == 4
    player = playable_objects(environment)["player_1"]
    playables.key_action(player, 1, 3)
    assert np.array_equal(drawn(addon, subject_of(environment, 50)), drawn(addon, after))
    playables.remove_curves(player, "location")
    player.location.x += 1.0
    assert not np.array_equal(drawn(addon, subject_of(environment, 50)), drawn(addon, after))


def test_a_scene_without_an_environment_says_what_to_do(scene):
    viewport = Viewport()
    viewport.read(scene.view_layers[0].depsgraph)
    assert "make one with New Playable Environment" in viewport.words
    with pytest.raises(ShotError, match="has no environment"):
        subject_of(scene)


def test_hidden_players_are_not_shown(environment, addon):
    shown = drawn(addon, subject_of(environment))
    playable_objects(environment)["player_1"].hide_render = True
    hidden = drawn(addon, subject_of(environment))
    assert (hidden[..., 0] == 230).sum() < (shown[..., 0] == 230).sum()


def test_a_failure_becomes_words_and_is_not_tried_again_and_again(environment, addon):
    addon.use_command(faulty("broken"))
    desk = Desk()
    drawer = Drawer(desk, addon)
    desk.want(subject_of(environment).seen_by(VIEW))
    drawer.go_on()
    wait_for(lambda: desk.failure)
    assert "No module named 'torch'" in desk.failure
    drawer.wait()
    drawer.go_on()
    assert not drawer.works and not desk.has_more


def test_a_render_takes_the_worker_and_the_preview_goes_on_afterwards(environment, addon):
    bpy.ops.playable.bake_paths()
    addon.use_command(faulty("slow"))
    desk = Desk()
    drawer = Drawer(desk, addon)
    desk.want(subject_of(environment).seen_by(VIEW))
    drawer.go_on()
    wait_for(lambda: addon.status == "busy")
    bpy.ops.render.render(scene=environment.name)
    assert desk.shown is None and not desk.failure
    drawer.wait()
    assert finished(drawer, desk).shape == (54, 96, 3)


def test_stopping_the_runtime_does_not_start_it_again_behind_the_users_back(environment, addon):
    addon.use_command(faulty("slow"))
    desk = Desk()
    drawer = Drawer(desk, addon)
    desk.want(subject_of(environment).seen_by(VIEW))
    drawer.go_on()
    wait_for(lambda: addon.status == "busy")
    addon.close()
    drawer.wait()
    assert desk.failure == STOPPED_MESSAGE
    drawer.go_on()
    assert not drawer.works and addon.worker_pid is None


def test_a_held_pose_is_held_at_rest_and_beyond_the_bake_too(environment, addon):
    player = playable_objects(environment)["player_1"]
    for frame, pose in ((1, "FREE"), (3, "HELD")):
        player.playable.overrides.pose = pose
        player.keyframe_insert("playable.overrides.pose", frame=frame)
    assert subject_of(environment, 10).take.track("player_1").poses == ()
    drawn(addon, subject_of(environment, 10))
    bpy.ops.playable.bake_paths()
    held = subject_of(environment, 4).take.track("player_1").poses
    assert [(key.frame, key.held) for key in held] == [(4, 3)]
    assert np.array_equal(
        drawn(addon, subject_of(environment, 10)), drawn(addon, subject_of(environment, 4))
    )


class TestDrawing:
    """A viewport without a window: what it would draw, and where."""

    @pytest.fixture
    def drawn_things(self, monkeypatch):
        from blender_addon.preview import drawing

        things = []
        monkeypatch.setattr(drawing, "texture_of", lambda rgb: rgb)
        monkeypatch.setattr(
            drawing, "draw_texture", lambda *given: things.append(("picture", given[2], given[3]))
        )
        monkeypatch.setattr(drawing, "draw_words", lambda words, *_: things.append(words))
        return things

    def context_of(self, scene, perspective="CAMERA", size=(96, 54)):
        depsgraph = scene.view_layers[0].depsgraph
        camera = scene.camera.evaluated_get(depsgraph)
        return SimpleNamespace(
            area=SimpleNamespace(regions=()),
            region=SimpleNamespace(width=size[0], height=size[1]),
            region_data=SimpleNamespace(
                view_perspective=perspective,
                window_matrix=camera.calc_matrix_camera(depsgraph, x=size[0], y=size[1]),
                view_matrix=camera.matrix_world.inverted(),
            ),
            space_data=SimpleNamespace(
                use_local_camera=False, camera=None, overlay=SimpleNamespace(show_overlays=True)
            ),
            preferences=SimpleNamespace(system=SimpleNamespace(ui_scale=1.0)),
        )

    def draw(self, viewport, scene, perspective="CAMERA", pixel_size=1):
        depsgraph = scene.view_layers[0].depsgraph
        engine = SimpleNamespace(get_preview_pixel_size=lambda _: pixel_size)
        viewport.read(depsgraph)
        viewport.draw(engine, self.context_of(scene, perspective), depsgraph)
        return viewport

    @pytest.mark.parametrize("perspective", ["CAMERA", "PERSP"])
    def test_the_picture_fills_the_frame(self, environment, addon, drawn_things, perspective):
        viewport = self.draw(Viewport(), environment, perspective)
        finished(viewport.drawer, viewport.desk)
        assert viewport.has_news
        drawn_things.clear()
        self.draw(viewport, environment, perspective)
        ((what, picture, rect),) = drawn_things
        assert (what, picture.shape) == ("picture", (54, 96, 3))
        assert (rect.left, rect.top, rect.width, rect.height) == (0, 0, 96, 54)
        assert not viewport.has_news

    def test_larger_preview_pixels_are_drawn_in_fewer(self, environment, addon, drawn_things):
        viewport = self.draw(Viewport(), environment, pixel_size=2)
        assert finished(viewport.drawer, viewport.desk).shape == (27, 48, 3)

    def test_a_view_from_the_side_says_what_to_press_and_recovers(
        self, environment, addon, drawn_things
    ):
        viewport = Viewport()
        context = self.context_of(environment, "ORTHO")
        context.region_data.window_matrix = np.diag([0.1, 0.1, -0.01, 1.0])
        depsgraph = environment.view_layers[0].depsgraph
        viewport.read(depsgraph)
        viewport.draw(None, context, depsgraph)
        assert drawn_things == [PERSPECTIVE_NEEDED] and not viewport.desk.has_more
        self.draw(viewport, environment)
        assert viewport.words == "" and viewport.desk.has_more

    def test_a_background_picture_that_covers_it_is_pointed_out(
        self, environment, addon, drawn_things
    ):
        lens = environment.camera.data
        lens.background_images.new()
        lens.show_background_images = True
        environment.view_layers[0].update()
        viewport = self.draw(Viewport(), environment)
        finished(viewport.drawer, viewport.desk)
        assert viewport.words == COVERED_MESSAGE
        self.draw(viewport, environment, "PERSP")
        assert viewport.words == ""

    def test_news_that_nobody_draws_end_the_wish(self, environment, monkeypatch, drawn_things):
        from blender_addon.preview import viewport as module

        viewport, now = self.draw(Viewport(), environment), [0.0]
        monkeypatch.setattr(module.time, "monotonic", lambda: now[0])
        viewport.note_news()
        assert viewport.desk.has_more
        now[0] += module.UNSEEN_SECONDS + 0.1
        viewport.note_news()
        assert not viewport.desk.has_more


def test_a_viewport_that_is_gone_wants_nothing_any_more(environment):
    viewport = Viewport()
    desk = viewport.desk
    desk.want(subject_of(environment).seen_by(VIEW))
    assert desk.has_more
    del viewport
    assert not desk.has_more


def test_engines_of_one_viewport_keep_their_desk_and_unregistering_ends_it(environment):
    from blender_addon.preview import ticking

    engine = SimpleNamespace()
    viewport = ticking.viewport_of(engine)
    assert ticking.viewport_of(engine) is viewport
    viewport.desk.want(subject_of(environment).seen_by(VIEW))
    ticking.keep_ticking()
    assert bpy.app.timers.is_registered(ticking._tick)
    ticking.unregister()
    assert not bpy.app.timers.is_registered(ticking._tick)
    assert not viewport.desk.has_more


def test_a_tick_has_pictures_drawn_until_all_is_there_and_then_ends(environment, addon):
    from blender_addon.preview import ticking

    viewport = ticking.viewport_of(SimpleNamespace())
    kept = ticking.viewport_of(holder := SimpleNamespace())
    del viewport
    kept.desk.want(subject_of(environment).seen_by(VIEW))
    wait_for(lambda: ticking._tick() and not kept.desk.has_more)
    assert kept.has_news and holder.viewport is kept
    kept._drawn = kept.desk.shown
    assert ticking._tick() is None
    ticking.unregister()
