"""The scene's film as one document that the command line and farms draw without Blender.

Each frame is asked for as the render engine asks for it; what repeats is written once.
"""

import dataclasses
from collections.abc import Callable, Sequence
from pathlib import Path, PurePath

from pe_runtime.contract.errors import ShotError
from pe_runtime.contract.shot import ObjectTrack, PoseKey, Shot, StyleMix

from ..bake import BAKE_AGAIN, Bake, Output, is_turned, take_of_moment
from ..complete_files import write_complete
from ..scene_bridge import Moment
from ..state_files import with_files

Look = tuple[tuple[str | None, str, float], ...]


def film_of(bake: Bake, moments: Sequence[Moment], fps: float, output: Output) -> Shot:
    """The whole baked shot with the cameras and overrides that the scene asks for now.

    Args:
        bake: The scene's.
        moments: One for every baked frame.
        fps: The scene's pace.
        output: What is wanted of the frames.

    Raises:
        ShotError: A frame cannot be drawn, or the camera that decides where players go has turned.
    """
    takes = [take_of_moment(bake, moment, fps, output) for moment in moments]
    _check_cameras(bake, takes)
    return dataclasses.replace(
        bake.shot,
        cameras=tuple(take.cameras[0] for take in takes),
        objects=tuple(_joined(track, bake, takes) for track in bake.shot.objects),
        quality=output.quality,
        passes=output.passes,
    )


def write_film(film: Shot, path: Path) -> list[Path]:
    """Write a shot, and its state files beside it, so that the folder can go anywhere.

    Returns:
        The files, the shot last.

    Raises:
        ShotError: The folder takes no file.
    """
    written: dict[str, Path] = {}

    def beside(state: str) -> str:
        name = PurePath(state).name
        if name not in written:
            write_complete(path.parent / name, Path(state).read_bytes())
            written[name] = path.parent / name
        return name

    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        text = with_files(film, beside).to_json()
        write_complete(path, text.encode())
    except OSError as error:
        raise ShotError(
            f"cannot write the shot to {path} ({error}); choose a folder that can be written"
        ) from error
    return [*written.values(), path]


def _check_cameras(bake: Bake, takes: Sequence[Shot]) -> None:
    """Players are led by the camera's directions: the film predicts again by its own."""
    if not any(track.actions for track in bake.shot.objects):
        return
    for baked, take in zip(bake.shot.cameras, takes, strict=True):
        if is_turned(baked, take.cameras[0]):
            raise ShotError(
                f"the camera has turned since the bake (frame {take.frame_start}), so that players "
                f"would go elsewhere when the shot is drawn without Blender; {BAKE_AGAIN}, then "
                "export"
            )


def _joined(track: ObjectTrack, bake: Bake, takes: Sequence[Shot]) -> ObjectTrack:
    """One object's track over all frames, from those of the single frames."""
    frames, parts = bake.shot.frames, [take.track(track.name) for take in takes]
    path, turns = bake.paths[track.name], bake.headings.get(track.name)

    def predicted(index: int) -> float:
        return 0.0 if turns is None else float(turns[index])

    return ObjectTrack(
        name=track.name,
        actions=track.actions,
        locations=_filled(parts, lambda part: part.locations, lambda i: tuple(path[i].tolist())),
        visible=_filled(parts, lambda part: part.visible, lambda _: True),
        headings=_filled(parts, lambda part: part.headings, predicted),
        styles=_style_keys(track.name, list(zip(frames, parts, strict=True))),
        poses=_pose_keys(list(zip(frames, parts, strict=True))),
    )


def _filled(
    parts: Sequence[ObjectTrack],
    asked: Callable[[ObjectTrack], tuple | None],
    otherwise: Callable[[int], object],
) -> tuple | None:
    """One value per frame, where any frame asks for one: what the others have is written out."""
    found = [asked(part) for part in parts]
    if not any(found):
        return None
    return tuple(each[0] if each else otherwise(i) for i, each in enumerate(found))


def _style_keys(name: str, parts: Sequence[tuple[int, ObjectTrack]]) -> tuple[StyleMix, ...]:
    keys: list[StyleMix] = []
    before: Look = ()
    for frame, part in parts:
        look = tuple((mix.image, mix.object, mix.weight) for mix in part.styles_at(frame))
        if look != before:
            # Nothing of itself: so a style ends.
            keys += [StyleMix(frame, *each) for each in look or ((None, name, 0.0),)]
        before = look
    return tuple(keys)


def _pose_keys(parts: Sequence[tuple[int, ObjectTrack]]) -> tuple[PoseKey, ...]:
    keys: list[PoseKey] = []
    for frame, part in parts:
        held = part.pose_at(frame)
        if held != (keys[-1].held if keys else None):
            keys.append(PoseKey(frame, held))
    return tuple(keys)
