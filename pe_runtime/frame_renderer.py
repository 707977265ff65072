"""Frames of a trained model, one after the other; what the next shares with the last is kept."""

import math
from collections.abc import Hashable, Mapping
from dataclasses import dataclass, replace

import torch
from jaxtyping import Float
from torch import Tensor

from pe_runtime.geometry.cameras import Cameras, ray_directions
from pe_runtime.networks import Codes, SynthesisNetworks
from pe_runtime.rendering.folded_field import FoldedField
from pe_runtime.rendering.folding import FieldFolder
from pe_runtime.rendering.frame_composition import Level
from pe_runtime.rendering.frame_drawing import (
    DrawnFeatures,
    KeptFrame,
    Placed,
    camera_key,
    draw_features,
    measure,
)
from pe_runtime.rendering.frame_passages import FrameObject, FrameRays
from pe_runtime.rendering.partial_decoding import Decoded, cells_of, decode, decode_again
from pe_runtime.rendering.prepared_renderer import PreparedRenderer, prepared
from pe_runtime.rendering.region_decoding import blank, decode_part, needed_regions
from pe_runtime.rendering.regions import Region
from pe_runtime.rendering.sampling import grid_pixels
from pe_runtime.rendering.scene import RenderSettings

BASE_STEP = 32.0
"""Depths of samples count from whole steps of at least so many radii of the largest object."""


@dataclass(frozen=True)
class Geometry:
    """Depth and shares of a frame at full image resolution.

    Attributes:
        depth: Planar metres; +inf where nothing solid covers half the pixel.
        masks: Share of each pixel that each visible object covers.
    """

    depth: Float[Tensor, "height width"]
    masks: Mapping[str, Float[Tensor, "height width"]]


class FrameRenderer:
    """Draws single frames with the synthesis module, without gradients.

    It remembers the last frame only, and only as long as that saves work: results never depend on
    what was drawn before.

    Args:
        networks: Trained synthesis module.
    """

    def __init__(self, networks: SynthesisNetworks) -> None:
        self.networks = networks
        self.config = networks.config
        self._classes = {each.name: each.class_name for each in self.config.objects}
        self._folders: dict[tuple[str, torch.dtype], FieldFolder] = {}
        self._folded: dict[str, tuple[tuple, FoldedField]] = {}
        self._rays: tuple[Hashable, FrameRays, list[Level]] | None = None
        self._kept: KeptFrame | None = None
        self._decoder: tuple[torch.dtype, PreparedRenderer] | None = None
        self._picture: Decoded | None = None

    def forget(self) -> None:
        """Free what is kept of the last frame."""
        self._folded, self._rays, self._kept, self._picture = {}, None, None, None

    @torch.inference_mode()
    def draw(
        self,
        camera: Cameras,
        codes: Mapping[str, Codes],
        settings: RenderSettings,
        region: Region | None = None,
    ) -> tuple[Float[Tensor, "3 height width"], dict[str, int]]:
        """Draw one frame, or a part of it.

        Args:
            camera: One camera.
            codes: States of one frame by object name.
            settings: Sampling and skipping.
            region: The pixels that are wanted; None for all of the camera's.

        Returns:
            sRGB picture in [0, 1] of the wanted pixels, and the counters of the composition.
        """
        if region is not None:
            return self._draw_part(camera, codes, settings, region)
        size, before = self.map_size(camera), self._picture
        if self._rays is None or self._rays[0] != (camera_key(camera), ()):
            before = None  # of no use for another view, and large
        drawn = self.features(camera, codes, settings)
        maps = self.networks.as_maps(drawn.maps, 1, size)
        picture = self._decoded(maps, drawn, settings, before)
        return picture[:, : camera.height, : camera.width].float(), drawn.statistics

    def _decoded(
        self,
        maps: list[Tensor],
        drawn: DrawnFeatures,
        settings: RenderSettings,
        before: Decoded | None,
    ) -> Float[Tensor, "3 height width"]:
        """The picture of feature maps; only what a change can reach is decoded again."""
        known, decoder = self._decoder, self._ready_decoder(settings)
        if known is not self._decoder:
            before = None
        if drawn.changed is None or before is None:
            picture, self._picture = decode(decoder, maps)
        else:
            shapes = [each.shape[-2:] for each in maps]
            changed = [c.reshape(shape) for c, shape in zip(drawn.changed, shapes, strict=True)]
            picture, self._picture = decode_again(decoder, maps, before, changed)
        if drawn.kept is None:
            self._picture = None
        return picture

    def _ready_decoder(self, settings: RenderSettings) -> PreparedRenderer:
        dtype = torch.bfloat16 if settings.bfloat16 else torch.float32
        if self._decoder is None or self._decoder[0] != dtype:
            self._decoder = (dtype, prepared(self.networks.feature_renderer, dtype))
        return self._decoder[1]

    def _draw_part(
        self,
        camera: Cameras,
        codes: Mapping[str, Codes],
        settings: RenderSettings,
        region: Region,
    ) -> tuple[Float[Tensor, "3 height width"], dict[str, int]]:
        """A part of a frame from the rays that it needs, each of them a ray of the whole."""
        decoder, size = self._ready_decoder(settings), self.map_size(camera)
        needed = needed_regions(decoder, size, region)
        strides = self.config.feature_renderer.strides
        drawn = self.features(camera, codes, settings, needed[: len(strides)])
        maps = []
        for stride, part, rows in zip(strides, needed, drawn.maps, strict=False):
            whole = blank(rows.shape[1], Region(0, 0, size[0] // stride, size[1] // stride), rows)
            cells = rows.reshape(part.height, part.width, -1).permute(2, 0, 1)[None]
            cells_of(whole, part).copy_(cells)
            maps.append(whole)
        picture = decode_part(decoder, maps, needed)
        return cells_of(picture, region).float(), drawn.statistics

    def map_size(self, camera: Cameras) -> tuple[int, int]:
        """Height and width in pixels that the feature maps of a frame cover."""
        coarsest = self.config.feature_renderer.strides[-1]
        # F reflects its borders, for which the coarsest map needs two rows and two columns.
        rows, columns = (max(2, -(-n // coarsest)) for n in (camera.height, camera.width))
        return rows * coarsest, columns * coarsest

    @torch.inference_mode()
    def features(
        self,
        camera: Cameras,
        codes: Mapping[str, Codes],
        settings: RenderSettings,
        parts: tuple[Region, ...] = (),
    ) -> DrawnFeatures:
        """Feature maps of one frame, finest first; the last frame's are taken over where equal.

        Args:
            camera: One camera.
            codes: States of one frame by object name.
            settings: Sampling and skipping.
            parts: Which cells of each map are wanted; empty for all.
        """
        settings = self.networks.complete(settings)
        placed = self._placed(codes, settings)
        rays, levels = self._frame_rays(camera, parts)
        rays = replace(rays, base=base_depth(camera, placed, settings))
        # Both are taken out: where a frame is interrupted, or only its features are asked for, the
        # picture is not the one that belongs to what is kept.
        kept, self._kept, self._picture = self._kept, None, None
        drawn = draw_features(rays, levels, placed, settings, kept)
        self._kept = drawn.kept
        return drawn

    @torch.inference_mode()
    def geometry(
        self,
        camera: Cameras,
        codes: Mapping[str, Codes],
        settings: RenderSettings,
        region: Region | None = None,
    ) -> Geometry:
        """Depth and masks at full image resolution, or of a region; no features are computed."""
        settings = self.networks.complete(settings)
        placed = self._placed(codes, settings)
        own = region or Region(0, 0, camera.height, camera.width)
        pixels = grid_pixels(own.top, own.left, own.height, own.width, 1)
        rays = self._rays_through(camera, pixels.to(camera.intrinsics.device))
        shape = own.height, own.width
        parts = () if region is None else (region,)
        rays = replace(rays, base=base_depth(camera, placed, settings), parts=parts)
        seen = measure(rays, placed, settings)
        kinds = [self.config.class_of(name).kind for name in placed]
        solid = [i for i, kind in enumerate(kinds) if kind != "sky"]
        covered = seen.shares[:, solid].sum(dim=1)
        depth = seen.depth / covered.clamp(min=1e-6) + rays.base
        depth = torch.where(covered >= 0.5, depth, torch.inf).reshape(shape)
        return Geometry(depth, {n: seen.shares[:, i].reshape(shape) for i, n in enumerate(placed)})

    def _frame_rays(
        self, camera: Cameras, parts: tuple[Region, ...]
    ) -> tuple[FrameRays, list[Level]]:
        """The rays of all levels; those of the last frame where its camera is this one's."""
        key = camera_key(camera), parts
        if self._rays is None or self._rays[0] != key:
            start, pixels, levels = 0, [], []
            channels, strides = self.networks.channels(), self.config.feature_renderer.strides
            height, width = self.map_size(camera)
            wholes = [Region(0, 0, height // stride, width // stride) for stride in strides]
            for stride, own, part in zip(strides, channels, parts or wholes, strict=True):
                bounds = (n * stride for n in (part.top, part.left, part.height, part.width))
                pixels.append(grid_pixels(*bounds, stride))
                levels.append(Level(slice(start, start + pixels[-1].shape[0]), own))
                start += pixels[-1].shape[0]
            rays = self._rays_through(camera, torch.cat(pixels).to(camera.intrinsics.device))
            self._rays = (key, replace(rays, parts=parts), levels)
        return self._rays[1:]

    def _rays_through(self, camera: Cameras, pixels: Tensor) -> FrameRays:
        frame = torch.zeros(pixels.shape[0], dtype=torch.long, device=pixels.device)
        directions = ray_directions(camera, frame, pixels, self.networks.ray_dtype)
        return FrameRays(camera, pixels, directions, directions.norm(dim=-1).float())

    def _placed(self, codes: Mapping[str, Codes], settings: RenderSettings) -> dict[str, Placed]:
        dtype = torch.bfloat16 if settings.bfloat16 else torch.float32
        placed, folded = {}, {}
        for name in self.networks.drawn(codes):
            own = codes[name]
            folded[name] = self._in_state(name, own, dtype)
            heading = 0.0 if own.heading is None else float(own.heading[0])
            shown = bool(own.visible[0])
            key = (folded[name][0], _bytes(own.position), heading, shown)
            placed[name] = Placed(
                key, FrameObject(folded[name][1], own.position[0], heading, shown)
            )
        self._folded = folded
        return placed

    def _in_state(self, name: str, codes: Codes, dtype: torch.dtype) -> tuple[tuple, FoldedField]:
        """An object's field with style and pose folded in, and a key of them."""
        looks = (dtype, _bytes(codes.style), _bytes(codes.pose))
        before = self._folded.get(name)
        if before is not None and before[0] == looks:
            return before
        place = self._classes[name], dtype
        if place not in self._folders:
            self._folders[place] = FieldFolder(self.networks.fields[place[0]], dtype)
        same_style = before is not None and before[0][:2] == looks[:2]
        like = before[1] if same_style else None
        return looks, self._folders[place].fold(codes.style[0], codes.pose[0], like)


def base_depth(camera: Cameras, placed: Mapping[str, Placed], settings: RenderSettings) -> float:
    """A planar depth in metres before which there is nothing; 0 for all but distant cameras.

    In coarse steps, so that it stays what it is while objects move.
    """
    if settings.release is not None:
        return 0.0
    centre, ahead = camera.centres[0].tolist(), camera.rotations[0, :, 2].tolist()
    nearest, largest = math.inf, 0.0
    for each in placed.values():
        config = each.object.field.config
        if config.kind == "sky":
            continue
        reach = [max(abs(a), abs(b)) for a, b in zip(config.low, config.high, strict=True)]
        radius = math.hypot(*reach)
        way = [p - c for p, c in zip(each.object.position.tolist(), centre, strict=True)]
        depth = sum(a * b for a, b in zip(way, ahead, strict=True)) - radius
        nearest, largest = min(nearest, depth), max(largest, radius)
    if not 0 < nearest < math.inf or largest == 0:
        return 0.0
    step = 2.0 ** math.ceil(math.log2(BASE_STEP * largest))
    return step * (nearest // step)


def _bytes(values: Tensor) -> bytes:
    return values.detach().cpu().numpy().tobytes()
