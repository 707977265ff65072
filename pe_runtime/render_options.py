"""What a frame is asked to hold: quality, part of the picture, further passes."""

from dataclasses import dataclass

from pe_runtime.config import QUALITIES, Quality
from pe_runtime.contract.camera import Camera
from pe_runtime.contract.errors import ConfigError


@dataclass(frozen=True)
class RenderOptions:
    """What a frame is to hold.

    Attributes:
        quality: "exact", "balanced" or "draft" (see `config.QUALITIES`), or switches of one's own.
        depth: Also give planar depth.
        masks: Objects whose share of each pixel is wanted.
        region: Left, top, width, height of the part of the camera's pixels that is drawn; None for
            all of them.
        layers: Playable objects that are wanted alone, with an alpha.
        background: Also give the picture without playable objects.
    """

    quality: str | Quality = "exact"
    depth: bool = False
    masks: tuple[str, ...] = ()
    region: tuple[int, int, int, int] | None = None
    layers: tuple[str, ...] = ()
    background: bool = False

    @property
    def switches(self) -> Quality:
        """The quality as switches.

        Raises:
            ConfigError: There is no quality of that name.
        """
        if isinstance(self.quality, Quality):
            return self.quality
        if self.quality not in QUALITIES:
            known = ", ".join(QUALITIES)
            raise ConfigError(f"no render quality {self.quality!r}; there are: {known}")
        return QUALITIES[self.quality]

    def size(self, camera: Camera) -> tuple[int, int]:
        """Height and width of what is drawn, pixels.

        Raises:
            ConfigError: The region is empty, or not within the camera's pixels.
        """
        if self.region is None:
            return camera.height, camera.width
        left, top, width, height = self.region
        fits = left + width <= camera.width and top + height <= camera.height
        if width < 1 or height < 1 or left < 0 or top < 0 or not fits:
            raise ConfigError(
                f"the region (left {left}, top {top}, width {width}, height {height}) is empty or "
                f"reaches beyond the {camera.width}x{camera.height} pixels of the camera"
            )
        return height, width
