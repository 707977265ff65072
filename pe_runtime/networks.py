"""The synthesis module: encoders, fields and feature renderer of one model."""

import itertools
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor, nn

from pe_runtime.config import ModelConfig
from pe_runtime.field.object_field import ObjectField
from pe_runtime.geometry.cameras import Cameras, ray_directions
from pe_runtime.perception.glimpse import Glimpse, Pictures, Place, look
from pe_runtime.perception.heading_encoder import HeadingEncoder
from pe_runtime.perception.localization import locate
from pe_runtime.perception.object_encoder import build_encoder
from pe_runtime.rendering.feature_renderer import build_feature_renderer
from pe_runtime.rendering.release_2022 import release_2022
from pe_runtime.rendering.renderer import compose
from pe_runtime.rendering.sampling import grid_pixels
from pe_runtime.rendering.scene import Rays, RenderSettings, SceneObject


@dataclass(frozen=True)
class Codes:
    """States of one object in every frame of a batch.

    Attributes:
        position: Metres, environment space.
        style: w of each frame.
        pose: pi of each frame.
        visible: Whether the object is there to be drawn.
        heading: Radians about the world's z axis; None where objects keep the world's axes.
    """

    position: Float[Tensor, "frames 3"]
    style: Float[Tensor, "frames style"]
    pose: Float[Tensor, "frames pose"]
    visible: Bool[Tensor, " frames"]
    heading: Float[Tensor, " frames"] | None = None


class SynthesisNetworks(nn.Module):
    """All networks of the synthesis module; objects of a class share theirs.

    Args:
        config: The environment.
    """

    def __init__(self, config: ModelConfig) -> None:
        super().__init__()
        self.config = config
        features = sum(config.feature_renderer.features)
        self.fields = nn.ModuleDict(
            {n: ObjectField(c, features) for n, c in config.classes.items()}
        )
        self.encoders = nn.ModuleDict({n: build_encoder(c) for n, c in config.classes.items()})
        self.feature_renderer = build_feature_renderer(config.feature_renderer)
        turning = {n: c.heading for n, c in config.classes.items() if c.heading is not None}
        self.headings = nn.ModuleDict({n: HeadingEncoder(each) for n, each in turning.items()})
        # Counts of this batch; where several processes train, those of all their batches.
        self.total: Callable[[Tensor], Tensor] = lambda counts: counts

    def encode(
        self,
        images: Float[Tensor, "frames 3 height width"],
        cameras: Cameras,
        boxes: Float[Tensor, "frames players 4"],
    ) -> dict[str, Codes]:
        """Encode pictures: position, style and pose of every object (paper, Sec. 3).

        Args:
            images: sRGB pictures in [0, 1].
            cameras: One camera per frame, with the pictures' pixel grid.
            boxes: Boxes of the playable objects, in the order of the configuration; pixels, NaN
                where an object was not found.

        Returns:
            Codes by object name. Objects without a usable position are not visible.
        """
        pictures = Pictures(images, cameras, self.config.native_up)
        found: dict[str, Codes] = {}
        for class_name, config in self.config.classes.items():
            names = [o.name for o in self.config.objects if o.class_name == class_name]
            if not names:
                continue
            if config.kind == "playable":
                order = [self.config.playable_names.index(n) for n in names]
                own = boxes[:, order]
                positions, valid = locate(cameras, own, config.foot_offset, config.lift)
            else:
                own, positions, valid = self._static(names, len(cameras), images.device)
            places = [Place(own[:, i], positions[:, i]) for i in range(len(names))]
            each = self._encode_class(class_name, pictures, places, valid)
            found |= dict(zip(names, each, strict=True))
        return {each.name: found[each.name] for each in self.config.objects}

    def _static(
        self, names: list[str], frames: int, device: torch.device
    ) -> tuple[Tensor, Tensor, Tensor]:
        places = {o.name: o.position for o in self.config.objects}
        positions = torch.tensor([places[n] for n in names], device=device).expand(frames, -1, -1)
        boxes = torch.full((frames, len(names), 4), torch.nan, device=device)
        return boxes, positions, torch.ones(frames, len(names), dtype=torch.bool, device=device)

    def _encode_class(
        self, class_name: str, pictures: Pictures, places: list[Place], valid: Tensor
    ) -> list[Codes]:
        """Encode all objects of a class in one batch, so that they share batch statistics."""
        config = self.config.classes[class_name]
        if config.heading is not None:
            places, valid = self._turned(class_name, pictures, places, valid)
        glimpse = look(config, pictures, places)
        visible = valid & glimpse.seen
        styles, poses = map(glimpse.split, self._look_up(class_name, glimpse, visible))
        return [
            Codes(place.positions, styles[i], poses[i], visible[:, i], place.headings)
            for i, place in enumerate(places)
        ]

    def _look_up(
        self, class_name: str, glimpse: Glimpse, visible: Bool[Tensor, "frames objects"]
    ) -> tuple[Float[Tensor, "crops style"], Float[Tensor, "crops pose"]]:
        """Codes of all crops. In training, crops that show nothing stay out of batch statistics."""
        encoder, shown = self.encoders[class_name], visible.T.flatten()
        if not self.training:
            return encoder(glimpse.crops, glimpse.view)
        there, crops = self.total(
            torch.stack([shown.sum(), torch.tensor(len(shown)).to(shown.device)])
        )
        # One crop alone has no statistics.
        if there == crops or there < 2:
            return encoder(glimpse.crops, glimpse.view)
        style, pose = (
            each.new_zeros(len(shown), each.shape[1]).index_put((shown,), each)
            for each in encoder(glimpse.crops[shown], glimpse.view[shown])
        )
        return style, pose

    def _turned(
        self, class_name: str, pictures: Pictures, places: list[Place], valid: Tensor
    ) -> tuple[list[Place], Tensor]:
        """The places with headings, and where those are known; elsewhere they are zero."""
        config = self.config.classes[class_name]
        glimpse = look(replace(config, encoder=config.heading), pictures, places)
        offsets = glimpse.split(self.headings[class_name](glimpse.crops, glimpse.view))
        about = pictures.cameras.headings.float()
        known = valid & glimpse.seen
        turned = [
            replace(place, headings=torch.where(known[:, i], about + offsets[i], 0.0))
            for i, place in enumerate(places)
        ]
        return turned, known

    def scene(self, codes: Mapping[str, Codes]) -> list[SceneObject]:
        """The renderer's view of a batch of states; objects that are never visible are left out."""
        classes = {each.name: each.class_name for each in self.config.objects}
        return [
            SceneObject(
                self.fields[classes[name]],
                codes[name].position,
                codes[name].style,
                codes[name].pose,
                codes[name].visible,
                codes[name].heading,
            )
            for name in self.drawn(codes)
        ]

    def drawn(self, codes: Mapping[str, Codes]) -> list[str]:
        """Names of the objects that the renderer needs to know of, in the order of `scene`."""
        names = [o.name for o in self.config.objects if o.name in codes]
        # In the authors' quadrature even a hidden sky ends what stands before it.
        kept = "sky" if self.config.quadrature == "release-2022" else None
        kinds = {name: self.config.class_of(name).kind for name in names}
        return [n for n in names if kinds[n] == kept or bool(codes[n].visible.any())]

    def complete(self, settings: RenderSettings) -> RenderSettings:
        """The settings with the quadrature of this model."""
        return replace(settings, release=release_2022(self.config))

    def synthesise(
        self,
        cameras: Cameras,
        codes: Mapping[str, Codes],
        windows: Int[Tensor, "frames 2"],
        size: tuple[int, int],
        settings: RenderSettings,
    ) -> Float[Tensor, "frames 3 height width"]:
        """Draw one window of every frame in one go (training).

        Args:
            cameras: One camera per frame.
            codes: States by object name.
            windows: Top row and left column of each frame's window, pixels; multiples of the
                coarsest stride keep windows aligned with full frames.
            size: Height and width of all windows, multiples of the coarsest stride.
            settings: Sampling.
        """
        renderer = self.config.feature_renderer
        pixels, frame, groups, start = [], [], [], 0
        corners = windows.tolist()
        for stride, channels in zip(renderer.strides, self.channels(), strict=True):
            for index, (top, left) in enumerate(corners):
                pixels.append(grid_pixels(top, left, *size, stride))
                frame.append(torch.full(pixels[-1].shape[:1], index))
            stop = start + len(corners) * pixels[-1].shape[0]
            groups.append((slice(start, stop), channels))
            start = stop
        device = cameras.intrinsics.device
        frames = torch.cat(frame).to(device)
        directions = ray_directions(cameras, frames, torch.cat(pixels).to(device), self.ray_dtype)
        rays = Rays(cameras.centres, directions, frames)
        composed = compose(rays, self.scene(codes), groups, self.complete(settings))
        return self.feature_renderer(self.as_maps(composed.features, len(corners), size))

    def channels(self) -> list[slice]:
        """Which channels of the fields each feature map takes, finest first."""
        ends = list(itertools.accumulate(self.config.feature_renderer.features))
        return [slice(a, b) for a, b in zip([0, *ends[:-1]], ends, strict=True)]

    def as_maps(self, features: list[Tensor], frames: int, size: tuple[int, int]) -> list[Tensor]:
        """Features of rays, row by row, as one image-like map per stride.

        Args:
            features: (rays, channels) of each stride, finest first.
            frames: Frames that follow each other in the rays.
            size: Height and width in pixels.
        """
        maps = []
        for stride, each in zip(self.config.feature_renderer.strides, features, strict=True):
            height, width = size[0] // stride, size[1] // stride
            maps.append(each.reshape(frames, height, width, -1).permute(0, 3, 1, 2))
        return maps

    @property
    def ray_dtype(self) -> torch.dtype:
        """In which directions of rays are computed: float64 but for "release-2022"."""
        return torch.float64 if self.config.quadrature == "interval" else torch.float32
