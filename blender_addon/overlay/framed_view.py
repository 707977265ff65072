"""What framing knows of a picture, as the overlay shows it: verdicts, wrapped words, marks."""

from collections.abc import Sequence

from pe_runtime.contract.camera import Camera

from ..framing.framed import FramedPicture
from ..framing.warnings import FramingWarning
from ..wrapping import wrapped
from .picture_marks import FINE, IMPOSSIBLE, OUTSIDE, GroundMark, PictureBox, PictureView

LINE_LENGTH = 46
"""Letters of a warning's line."""


def view_of(framed: FramedPicture, eye: Camera, with_points: bool = True) -> PictureView:
    """A framed picture as the overlay draws it.

    Args:
        framed: What is known of it.
        eye: The camera that saw it or, while that is unknown, the one that one looks through.
        with_points: Whether its ground points have a say.
    """
    points = framed.points if with_points else ()
    facts, about_camera = framed.facts, framed.warnings.get("", ())
    known = facts.envelope if facts else None
    said = {name: framed.warnings.get(name, ()) for name in framed.boxes}
    boxes = tuple(
        PictureBox(name, box, verdict_of(said[name]), words_of(said[name]))
        for name, box in framed.boxes.items()
    )
    verdict, words = verdict_of(about_camera), words_of(about_camera)
    if framed.trouble:
        verdict, words = IMPOSSIBLE, _wrapped(framed.trouble)
    return PictureView(
        eye,
        boxes,
        facts.volumes if facts else {},
        known.positions if known else None,
        tuple(GroundMark(each.name, each.pixel, each.place) for each in points),
        verdict,
        words,
        framed.camera is not None,
    )


def verdict_of(said: Sequence[FramingWarning]) -> str:
    """The worst of what is said."""
    if not said:
        return FINE
    return IMPOSSIBLE if any(each.impossible for each in said) else OUTSIDE


def words_of(said: Sequence[FramingWarning]) -> str:
    """All of what is said, in short lines."""
    return "\n".join(_wrapped(each.text) for each in said)


def _wrapped(text: str) -> str:
    # Names of objects stay as they are.
    text = text[:1].upper() + text[1:] if text.startswith("the ") else text
    return "\n".join(wrapped(text, LINE_LENGTH))
