"""Whether a PNG file is whole, and of which size. No `bpy` here.

Blender writes its files in place and calls a cut one a success, so each is read before it counts.
"""

import zlib
from dataclasses import dataclass
from pathlib import Path

from pe_runtime.contract.errors import ShotError

SIGNATURE = b"\x89PNG\r\n\x1a\n"
RGB_OF_BYTES = bytes((8, 2))
"""Bits per channel and colour type, as the header says them."""


@dataclass(frozen=True)
class FileFacts:
    """What a file is known again by.

    Attributes:
        size: Bytes.
        crc: CRC-32 over them.
    """

    size: int
    crc: int


def facts_of(content: bytes) -> FileFacts:
    """What these bytes are known again by."""
    return FileFacts(len(content), zlib.crc32(content))


def check_png(content: bytes, size: tuple[int, int], path: Path) -> None:
    """Make sure that the bytes are a whole 8-bit RGB picture.

    Args:
        content: The file's bytes.
        size: Width and height in pixels that are expected.
        path: Named in errors.

    Raises:
        ShotError: They are cut off, damaged, or of another size or kind.
    """
    chunks = list(_chunks(content, path))
    if not chunks or chunks[-1][0] != b"IEND":
        raise ShotError(_cut(path, len(content)))
    kind, header = chunks[0]
    found = tuple(int.from_bytes(header[at : at + 4], "big") for at in (0, 4))
    if kind != b"IHDR" or found != size or header[8:10] != RGB_OF_BYTES:
        raise ShotError(
            f"{path}: expected an 8-bit RGB picture of {size[0]}x{size[1]} pixels, found one of "
            f"{found[0]}x{found[1]}"
        )


def _chunks(content: bytes, path: Path) -> list[tuple[bytes, bytes]]:
    """Names and the first bytes of the chunks, each checked by its own CRC."""
    view, found, at = memoryview(content), [], len(SIGNATURE)
    if not content.startswith(SIGNATURE):
        raise ShotError(_cut(path, len(content)))
    while at < len(content) and (not found or found[-1][0] != b"IEND"):
        length = int.from_bytes(view[at : at + 4], "big")
        body, end = view[at + 4 : at + 8 + length], at + 12 + length
        if end > len(content) or zlib.crc32(body) != int.from_bytes(view[end - 4 : end], "big"):
            raise ShotError(_cut(path, len(content)))
        found.append((bytes(body[:4]), bytes(body[4:24])))
        at = end
    return found


def _cut(path: Path, size: int) -> str:
    return (
        f"{path} was not written whole ({size} bytes); the disk may be full: free some space and "
        "render again, finished frames are kept"
    )
