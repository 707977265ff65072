"""Frames as one video file."""

from collections.abc import Sequence
from pathlib import Path

import cv2

from pe_runtime.images import ImageError


def write_video(frames: Sequence[Path], fps: float, output: str | Path) -> None:
    """Join pictures of one size into an mp4; an odd last row or column is cut off.

    Raises:
        ImageError: A frame is missing or of another size, or the file cannot be written.
    """
    unfinished = Path(output).with_name(f".{Path(output).stem}.part.mp4")
    writer, size = None, None
    try:
        for path in frames:
            picture = cv2.imread(str(path))
            if picture is None:
                raise ImageError(f"{path}: cannot be read; render it again")
            # The codec halves its colours, so it has no odd sizes.
            height, width = (extent // 2 * 2 for extent in picture.shape[:2])
            if writer is None:
                size = (width, height)
                writer = cv2.VideoWriter(
                    str(unfinished), cv2.VideoWriter.fourcc(*"mp4v"), fps, size
                )
            if (width, height) != size or not writer.isOpened():
                raise ImageError(f"{output}: cannot write {path} ({width}x{height}) into a video")
            writer.write(picture[:height, :width])
    finally:
        if writer is not None:
            writer.release()
    if writer is None:
        raise ImageError(f"{output}: there are no frames to join")
    unfinished.replace(output)
