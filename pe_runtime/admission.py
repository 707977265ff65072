"""What the environment refuses at its door, in words that say what to do instead."""

from collections.abc import Mapping, Sequence

import numpy as np

from pe_runtime.config import ModelConfig
from pe_runtime.contract.camera import Camera
from pe_runtime.contract.errors import CameraError, ConfigError
from pe_runtime.networks import Codes
from pe_runtime.render_options import RenderOptions
from pe_runtime.state import EnvironmentState


def check_picture(image: np.ndarray, camera: Camera) -> None:
    """Refuse what is no sRGB picture in [0, 1] of the camera's size.

    Raises:
        ConfigError: Wrong shape, type or size, NaN pixels, or values beyond [0, 1].
    """
    if image.ndim != 3 or image.shape[2] != 3 or 0 in image.shape:
        raise ConfigError(f"a picture must be (height, width, 3), found {image.shape}")
    if image.shape[:2] != (camera.height, camera.width):
        raise ConfigError(
            f"the picture has {image.shape[1]}x{image.shape[0]} pixels, its camera "
            f"{camera.width}x{camera.height}; give the camera that took this picture"
        )
    bad = int((~np.isfinite(image)).any(axis=-1).sum())
    if bad:
        raise ConfigError(f"the picture has {bad} pixels that are NaN or infinite; repair it first")
    if not np.issubdtype(image.dtype, np.floating) or image.min() < 0 or image.max() > 1:
        raise ConfigError(
            f"a picture must be floating-point sRGB in [0, 1]; found {image.dtype} from "
            f"{image.min()} to {image.max()}. Divide 8-bit values by 255."
        )


def check_found(
    codes: Mapping[str, Codes], boxes: Mapping[str, Sequence[float]], camera: Camera
) -> None:
    """Refuse boxes that gave no position or no crop.

    Raises:
        CameraError: A box has no area or lies outside the picture, or its foot is no point on the
            ground.
    """
    for name, box in boxes.items():
        if bool(codes[name].visible[0]):
            continue
        left, top, right, bottom = (float(edge) for edge in box)
        if not (right > left and bottom > top):
            raise CameraError(
                f"the box of {name!r} has no area: left {left:g}, top {top:g}, right {right:g}, "
                f"bottom {bottom:g} pixels"
            )
        if right <= 0 or left >= camera.width or bottom <= 0 or top >= camera.height:
            raise CameraError(
                f"the box of {name!r} ({left:g}, {top:g}, {right:g}, {bottom:g}) lies outside the "
                f"picture of {camera.width}x{camera.height} pixels; leave the box out if the "
                "object is not in the picture"
            )
        raise CameraError(
            f"{name!r} has no place on the ground: the middle of its box's lower edge "
            f"({(left + right) / 2:g}, {bottom:g}) is at or above the horizon, or the object is "
            "behind the camera. Check the box and the camera."
        )


def check_state(config: ModelConfig, state: EnvironmentState) -> None:
    """Refuse a state that another model made.

    Raises:
        ConfigError: Objects are unknown or missing, or their codes have other lengths.
    """
    missing = [each.name for each in config.objects if each.name not in state.objects]
    if missing:
        raise ConfigError(
            f"the state has no {missing[0]!r}; hide objects instead of leaving them out, and use "
            f"states of this model ({config.name!r})"
        )
    for name, each in state.objects.items():
        expected = config.class_of(name)
        lengths = (each.style.numel(), each.pose.numel())
        if lengths != (expected.style_features, expected.pose_features):
            raise ConfigError(
                f"style and pose of {name!r} have {lengths[0]} and {lengths[1]} numbers, in this "
                f"model {expected.style_features} and {expected.pose_features}: the state is from "
                "another model; encode the picture again"
            )


def check_options(options: RenderOptions, camera: Camera, config: ModelConfig) -> None:
    """Refuse frames that cannot be drawn.

    Raises:
        ConfigError: Unknown quality, mask or layer, or a region outside of the camera's pixels.
    """
    options.switches  # noqa: B018 -- an unknown quality has none
    options.size(camera)
    for name in options.masks:
        config.class_of(name)
    for name in options.layers:
        if name not in config.playable_names:
            known = ", ".join(config.playable_names) or "none"
            raise ConfigError(f"no layer of {name!r}; playable objects have one: {known}")
