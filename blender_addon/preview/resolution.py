"""How many pixels a preview may have so that it keeps up with the hand. No `bpy` here."""

from pe_runtime.contract.shot import Region

QUICK_SECONDS = 0.12
"""What a picture may take while the view moves."""
BAND_SECONDS = 0.3
"""What a part of the full picture may take: for so long nobody else can have the worker."""
SCALES = (1.0, 0.7, 0.5, 0.35, 0.25, 0.18, 0.125)
FIRST_SCALE = 0.25
SMALLEST_SIDE = 24
BAND_ROWS = 16
"""A band has a multiple of these rows."""
Size = tuple[int, int]


class Cost:
    """Seconds that a pixel takes, as a mean in which the last pictures weigh most."""

    def __init__(self) -> None:
        self.seconds_per_pixel: float | None = None

    def note(self, size: Size, seconds: float) -> None:
        """Learn from a picture of a size."""
        latest, mean = seconds / (size[0] * size[1]), self.seconds_per_pixel
        self.seconds_per_pixel = latest if mean is None else (latest + mean) / 2


def quick_size(full: Size, seconds_per_pixel: float | None) -> Size:
    """The size of a picture that is drawn while the view moves.

    Sizes change in steps, so that the picture does not swim.
    """
    fitting = (
        scale
        for scale in SCALES
        if seconds_per_pixel is not None
        and seconds_per_pixel * full[0] * full[1] * scale**2 <= QUICK_SECONDS
    )
    least = FIRST_SCALE if seconds_per_pixel is None else SCALES[-1]
    scale = next(fitting, least)
    width, height = (max(round(side * scale), min(side, SMALLEST_SIDE)) for side in full)
    return width, height


def next_band(full: Size, rows_done: int, seconds_per_pixel: float | None) -> Region:
    """The part of the full picture that is drawn next, as wide as the picture."""
    width, height = full
    rows = BAND_ROWS
    if seconds_per_pixel:
        affordable = BAND_SECONDS / (seconds_per_pixel * width)
        rows = max(int(affordable) // BAND_ROWS, 1) * BAND_ROWS
    return 0, rows_done, width, min(rows, height - rows_done)
