"""Frames as one video file."""

from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np

from pe_runtime.images import ImageError, read_image, to_uint8


def write_video(frames: Sequence[Path], fps: float, output: str | Path) -> None:
    """Join pictures of one size into an mp4; an odd last row or column is cut off.

    Raises:
        ImageError: A frame is missing or of another size, or the file cannot be written.
    """
    unfinished = Path(output).with_name(f".{Path(output).stem}.part.mp4")
    if not frames:
        raise ImageError(f"{output}: there are no frames to join")
    try:
        _join(frames, fps, unfinished)
        unfinished.replace(output)
    finally:
        unfinished.unlink(missing_ok=True)


def _join(frames: Sequence[Path], fps: float, output: Path) -> None:
    # The codec halves the resolution of its colours, so it has no odd sizes.
    first = _read(frames[0])
    height, width = (extent // 2 * 2 for extent in first.shape[:2])
    writer = cv2.VideoWriter(str(output), cv2.VideoWriter.fourcc(*"mp4v"), fps, (width, height))
    try:
        if not writer.isOpened():
            raise ImageError(f"{output.parent}: cannot write a video of {width}x{height} there")
        for path in frames:
            picture = _read(path)
            if picture.shape != first.shape:
                raise ImageError(
                    f"{path}: expected the size of {frames[0]}, {first.shape[1]}x{first.shape[0]}, "
                    f"found {picture.shape[1]}x{picture.shape[0]}; render it again"
                )
            writer.write(picture[:height, :width])
    finally:
        writer.release()


def _read(path: Path) -> np.ndarray:
    """Pixels in OpenCV's order, blue first."""
    return to_uint8(read_image(path))[..., ::-1]
