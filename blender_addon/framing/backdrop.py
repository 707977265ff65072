"""The picture behind a camera, so that an artist who looks through it sees what is being framed."""

from pathlib import Path

import bpy

Size = tuple[int, int]


def picture_image(scene: bpy.types.Scene, path: str) -> bpy.types.Image:
    """The Image that shows a scene's picture: the chosen one, or one that is loaded for a file."""
    framing = scene.playable_environment.framing
    if framing.picture_source == "IMAGE" and framing.image is not None:
        return framing.image
    return bpy.data.images.load(path, check_existing=True)


def show_behind(holder: bpy.types.Object, image: bpy.types.Image, before: object) -> None:
    """Fill a camera's frame with an Image, in place of the one that was there before.

    Args:
        holder: Camera object; other background images of it stay.
        image: Fills the frame, whatever its shape.
        before: The Image that was shown until now, or None.
    """
    lens = holder.data
    shown = next((each for each in lens.background_images if each.image in (image, before)), None)
    shown = shown or lens.background_images.new()
    shown.source, shown.image = "IMAGE", image
    shown.show_background_image, shown.alpha = True, 1.0
    shown.display_depth, shown.frame_method = "BACK", "STRETCH"
    lens.show_background_images = True


def hide_behind(holder: bpy.types.Object, image: bpy.types.Image) -> None:
    """Show an Image behind a camera no longer; it stays there to be switched on again.

    In Rendered shading Blender draws it over everything that is not a mesh, so over the preview.
    """
    for each in holder.data.background_images:
        if each.image == image:
            each.show_background_image = False


def shown_size(scene: bpy.types.Scene) -> Size | None:
    """Width and height of the picture that is being framed; None while nobody has looked at it."""
    settings = scene.playable_environment
    framing, image = settings.framing, settings.framing.backdrop
    if framing.picture_source == "IMAGE":
        image = framing.image
    elif framing.picture_source == "FILE" and image is not None:
        image = image if _same_file(image.filepath, settings.image_path) else None
    if image is None or not image.size[0] * image.size[1]:
        return None
    return image.size[0], image.size[1]


def _same_file(first: str, second: str) -> bool:
    return bool(second) and Path(bpy.path.abspath(first)) == Path(bpy.path.abspath(second))
