"""Blender geometry between two players: behind the near one, before the far one."""

import numpy as np
import pytest
from addon import stage
from addon.stage import read_png

bpy = pytest.importorskip("bpy")
pytestmark = pytest.mark.blender

from blender_addon.examples import passing_cube  # noqa: E402
from blender_addon.examples.demo_scene import DemoSpec  # noqa: E402
from blender_addon.scene_bridge import playable_objects  # noqa: E402

BOXES = {"player_1": (16.0, 8.0, 25.0, 34.0), "player_2": (38.0, 8.0, 45.0, 25.5)}
WIDTH, HEIGHT, FRAMES = 64, 36, 24


@pytest.fixture
def spec(picture, tmp_path, monkeypatch):
    monkeypatch.setattr(passing_cube, "SAMPLES", 2)
    yield DemoSpec(
        image=str(picture),
        camera=stage.front_camera().as_dict(),
        boxes=BOXES,
        model="duel",
        out=str(tmp_path),
        width=WIDTH,
        height=HEIGHT,
        frame_end=FRAMES,
        worker=stage.FAKE,
    )
    import blender_addon

    blender_addon.unregister()
    bpy.ops.wm.read_factory_settings(use_empty=True)


def pictures(files):
    return np.stack([read_png(file) for file in files]).astype(int)


def block(frames, channel_value):
    """Where the fake worker's block of one player is, by its green value."""
    return (frames[..., 0] == 230) & (frames[..., 1] == channel_value)


def test_the_cube_passes_behind_the_near_player_and_before_the_far_one(spec, tmp_path):
    made = passing_cube.film(spec)
    before, after = pictures(made["before"]), pictures(made["after"])
    assert before.shape == after.shape == (FRAMES, HEIGHT, WIDTH, 3)
    changed = np.abs(before - after).max(axis=-1) > 0
    near, far = block(before, 40), block(before, 190)
    assert near.any(axis=(1, 2)).all() and far.any(axis=(1, 2)).all()
    assert any(on_both_sides(changed[n], near[n]) for n in range(FRAMES))
    assert not changed[inside(near)].any()
    assert changed[far].any() and not changed[far].all()
    assert (tmp_path / "passing_cube.blend").is_file()


def inside(masks):
    """The pixels with none beside them outside: where the compositor smooths edges is left out."""
    rows = masks & np.roll(masks, 1, axis=1) & np.roll(masks, -1, axis=1)
    return rows & np.roll(rows, 1, axis=2) & np.roll(rows, -1, axis=2)


def on_both_sides(changed, hidden):
    """Whether something shows to the left and to the right of what hides its middle."""
    columns, seen = np.flatnonzero(hidden.any(axis=0)), changed.any(axis=0)
    left, right = columns[0], columns[-1] + 1
    return bool(seen[left - 4 : left].any() and seen[right : right + 4].any())


def test_nothing_changes_where_the_cube_is_not_in_view(spec):
    players, cube = passing_cube.build(spec)
    cube.objects["Cube"].animation_data_clear()
    cube.objects["Cube"].location = 0.0, 0.0, -50.0
    players.frame_end = 2
    found = []
    for composes in (False, True):
        players.render.use_compositing = composes
        players.render.filepath = f"{spec.out}/{composes}_####"
        bpy.ops.render.render(animation=True, scene=players.name)
        found.append(read_png(f"{spec.out}/{composes}_0002.png"))
    assert np.array_equal(*found)


def test_a_cube_needs_two_players_to_pass_between(spec):
    import dataclasses

    from pe_runtime.contract.errors import ShotError

    alone = dataclasses.replace(spec, boxes={"player_1": BOXES["player_1"]})
    with pytest.raises(ShotError, match="between two players"):
        passing_cube.build(alone)
    assert list(playable_objects(bpy.data.scenes["Players"])) == ["player_1"]
