"""Pixels on disk: pictures in, PNG and EXR out, every file written whole or not at all.

Inside the program a picture is (height, width, 3) float32 in [0, 1], display-referred sRGB.
"""

import uuid
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import OpenImageIO as oiio  # noqa: N813 the name its manual uses

from pe_runtime.contract.errors import PlayableEnvironmentError

# A file must not depend on when it was written: OpenEXR would store the time of day.
NO_TIME = "1970:01:01 00:00:00"


class ImageError(PlayableEnvironmentError):
    """A picture is missing, unreadable, not finite, or cannot be written."""


def read_image(path: str | Path, background: float | None = None) -> np.ndarray:
    """Read a picture as (height, width, 3) float32 in [0, 1], sRGB.

    8- and 16-bit files are taken as sRGB; float files (EXR) as scene-linear, and encoded. Grey
    becomes colour, values of float files outside [0, 1] are clipped.

    Args:
        path: The file.
        background: Grey that shows where an 8- or 16-bit picture is transparent; without it alpha
            is dropped.

    Raises:
        ImageError: The file is missing, damaged, or holds NaN or infinity.
    """
    pixels, spec = _read(path)
    colours = _colour_channels(pixels, spec, path)
    if not np.issubdtype(pixels.dtype, np.integer):
        check_finite(colours, str(path))
        return srgb_from_linear(np.clip(colours, 0.0, 1.0).astype(np.float32))
    white = np.float32(np.iinfo(pixels.dtype).max)
    colours = colours.astype(np.float32) / white
    if background is None or spec.alpha_channel < 0:
        return colours
    cover = pixels[..., spec.alpha_channel, None].astype(np.float32) / white
    return colours * cover + np.float32(background) * (1 - cover)


def is_rgb_png(path: str | Path, size: tuple[int, int]) -> bool:
    """Whether a file is what `write_png` writes of a picture: 8-bit RGB, (width, height) pixels."""
    source = oiio.ImageInput.open(str(path))
    if source is None:
        oiio.geterror()  # An unread message would be reported as leaked at exit.
        return False
    spec, kind = source.spec(), source.format_name()
    source.close()
    channels = (spec.nchannels, spec.alpha_channel, spec.format.basetype)
    return kind == "png" and channels == (3, -1, oiio.UINT8) and (spec.width, spec.height) == size


def read_metadata(path: str | Path) -> dict[str, str]:
    """Text entries that ``write_png`` or ``write_exr`` stored; empty if the file is unreadable."""
    source = oiio.ImageInput.open(str(path))
    if source is None:
        oiio.geterror()  # An unread message would be reported as leaked at exit.
        return {}
    texts = {each.name: each.value for each in source.spec().extra_attribs}
    source.close()
    return {name: text for name, text in texts.items() if isinstance(text, str)}


def write_png(
    path: str | Path, pixels: np.ndarray, metadata: Mapping[str, str] | None = None
) -> None:
    """Write an 8-bit PNG atomically; equal input gives equal bytes.

    Args:
        path: File to write; an existing one is replaced.
        pixels: (height, width, 3) picture or (height, width) mask, uint8, or float in [0, 1]
            rounded half up.
        metadata: Texts stored in the file.

    Raises:
        ImageError: The pixels are not finite, or the file cannot be written.
    """
    if pixels.dtype != np.uint8:
        check_finite(pixels, str(path))
        pixels = to_uint8(pixels)
    pixels = pixels[..., None] if pixels.ndim == 2 else pixels
    names = {1: ["Y"], 3: ["R", "G", "B"]}[pixels.shape[2]]
    _write(Path(path), pixels, names, dict(metadata or {}))


def write_exr(
    path: str | Path, channels: Mapping[str, np.ndarray], metadata: Mapping[str, str] | None = None
) -> None:
    """Write a float32 EXR atomically.

    Args:
        path: File to write; an existing one is replaced.
        channels: (height, width) arrays by channel name: ``R G B`` scene-linear, ``Z`` planar
            depth in metres (+inf where nothing is), masks as ``mask.NAME``.
        metadata: Texts stored in the file.

    Raises:
        ImageError: A channel holds NaN, or the file cannot be written.
    """
    for name, values in channels.items():
        # Infinity is a depth; NaN never is an answer.
        check_finite(np.where(np.isinf(values), 0.0, values), f"channel {name!r} of {path}")
    pixels = np.stack([np.asarray(values, np.float32) for values in channels.values()], axis=-1)
    attributes = dict(metadata or {}) | {"compression": "zip", "DateTime": NO_TIME}
    _write(Path(path), pixels, list(channels), attributes)


def to_uint8(pixels: np.ndarray) -> np.ndarray:
    """Floats in [0, 1] as bytes, rounded half up, clipped."""
    # float64, since adding 0.5 in float32 lifts the number just below one half over it.
    scaled = np.floor(pixels.astype(np.float64) * 255.0 + 0.5)
    return np.clip(scaled, 0.0, 255.0).astype(np.uint8)


def srgb_from_linear(linear: np.ndarray) -> np.ndarray:
    """Encode scene-linear values with the piecewise sRGB curve; the dtype is kept."""
    values = linear.astype(np.float64)
    curve = 1.055 * np.maximum(values, 0.0031308) ** (1 / 2.4) - 0.055
    return np.where(values <= 0.0031308, values * 12.92, curve).astype(linear.dtype)


def linear_from_srgb(encoded: np.ndarray) -> np.ndarray:
    """Decode sRGB values to scene-linear light; the dtype is kept."""
    values = encoded.astype(np.float64)
    curve = ((np.maximum(values, 0.04045) + 0.055) / 1.055) ** 2.4
    return np.where(values <= 0.04045, values / 12.92, curve).astype(encoded.dtype)


def check_finite(pixels: np.ndarray, where: str) -> None:
    """Refuse a picture with NaN or infinity, naming the first such pixel.

    Raises:
        ImageError: A value is not finite.
    """
    bad = ~np.isfinite(pixels)
    if bad.any():
        row, column = np.argwhere(bad)[0][:2]
        raise ImageError(
            f"{where}: {int(bad.sum())} of {pixels.size} values are NaN or infinite, the first at "
            f"column {column}, row {row} (from the top-left corner); repair the picture or choose "
            "another frame"
        )


def _read(path: str | Path) -> tuple[np.ndarray, "oiio.ImageSpec"]:
    """Pixels (height, width, channels) in the file's own number type, and its description."""
    if not Path(path).is_file():
        raise ImageError(f"{path}: no such picture; expected a PNG, JPEG or EXR file")
    hints = oiio.ImageSpec()
    hints.attribute("oiio:UnassociatedAlpha", 1)  # Else colours come multiplied by alpha.
    source = oiio.ImageInput.open(str(path), hints)
    if source is None:
        raise ImageError(f"{path}: cannot be read as a picture ({oiio.geterror().strip()})")
    spec = source.spec()
    pixels = source.read_image(oiio.UNKNOWN)  # Unknown means the file's own type.
    problem = source.geterror().strip()
    source.close()
    if pixels is None or problem:
        raise ImageError(f"{path}: the file is damaged ({problem})")
    return pixels.reshape(spec.height, spec.width, spec.nchannels), spec


def _colour_channels(pixels: np.ndarray, spec: "oiio.ImageSpec", path: str | Path) -> np.ndarray:
    """The (height, width, 3) colours among the channels, found by name."""
    places = {}
    for index, name in enumerate(spec.channelnames):
        places.setdefault(name.rsplit(".", 1)[-1].upper(), index)
    if all(name in places for name in "RGB"):
        return pixels[..., [places[name] for name in "RGB"]]
    grey = [index for index in range(spec.nchannels) if index != spec.alpha_channel]
    if len(grey) == 1:
        return np.repeat(pixels[..., grey], 3, axis=-1)
    raise ImageError(
        f"{path}: expected the channels R, G, B or one of grey, found "
        f"{', '.join(spec.channelnames)}; save it as RGB"
    )


def _write(path: Path, pixels: np.ndarray, names: list[str], attributes: Mapping[str, str]) -> None:
    height, width, channels = pixels.shape
    spec = oiio.ImageSpec(width, height, channels, pixels.dtype.name.replace("32", ""))
    spec.channelnames = names
    for name, text in attributes.items():
        spec.attribute(name, text)
    with _replacing(path) as temporary:
        output = oiio.ImageOutput.create(str(temporary))
        if output is None:
            raise ImageError(f"{path}: cannot be written ({oiio.geterror().strip()})")
        done = output.open(str(temporary), spec)
        done = done and output.write_image(np.ascontiguousarray(pixels)) and output.close()
        if not done:
            raise ImageError(f"{path}: cannot be written ({output.geterror().strip()})")


@contextmanager
def _replacing(path: Path) -> Iterator[Path]:
    """A temporary neighbour of ``path`` that takes its place if nothing fails."""
    # Same folder, so that the rename stays on one disk; same ending, which decides the format.
    temporary = path.with_name(f".{path.stem}.{uuid.uuid4().hex}{path.suffix}")
    try:
        yield temporary
        temporary.replace(path)
    except OSError as error:
        raise ImageError(f"{path}: cannot be written ({error})") from error
    finally:
        temporary.unlink(missing_ok=True)
