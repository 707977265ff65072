"""What the renderer is given: rays, objects, and how finely to look."""

from dataclasses import dataclass

from jaxtyping import Bool, Float, Int
from torch import Tensor

from pe_runtime.field.object_field import ObjectField
from pe_runtime.rendering.release_2022 import Release2022


@dataclass(frozen=True)
class Rays:
    """Rays of several frames.

    Attributes:
        centres: Camera centre of each frame, metres; float64 so that far-away cameras stay exact.
        directions: World directions per metre of planar depth; float64.
        frame: Frame of each ray.
    """

    centres: Float[Tensor, "frames 3"]
    directions: Float[Tensor, "rays 3"]
    frame: Int[Tensor, " rays"]


@dataclass(frozen=True)
class SceneObject:
    """One object as the renderer sees it, in every frame of a batch.

    `heading` turns it about the world's z axis, in radians; None keeps the world's axes.
    """

    field: ObjectField
    position: Float[Tensor, "frames 3"]
    style: Float[Tensor, "frames style"]
    pose: Float[Tensor, "frames pose"]
    visible: Bool[Tensor, " frames"]
    heading: Float[Tensor, " frames"] | None = None


@dataclass(frozen=True)
class RenderSettings:
    """How rays are sampled and what is left out.

    Attributes:
        near: Planar depth before which nothing is drawn, metres.
        jitter: Draw samples at random places of their intervals (training).
        density_noise: Standard deviation of noise on raw densities (training).
        weight_threshold: Samples of no more weight than this get no features; 0 is exact.
        sample_share: Share of each class's samples that is drawn.
        occupancy: Look coarsely first, and evaluate players only where something was found.
        termination: Samples that no more light than this reaches are not evaluated; 0 is exact.
        bfloat16: Products in bfloat16 (single frames only; training has its own switch).
        remember: Keep features of static samples for the frames to come.
        release: The authors' quadrature instead of ours, for their checkpoints.
        bucket: Row counts are padded to multiples of this, so that kernels are not re-tuned.
    """

    near: float = 0.05
    jitter: bool = False
    density_noise: float = 0.0
    weight_threshold: float = 0.0
    sample_share: float = 1.0
    occupancy: bool = False
    termination: float = 0.0
    bfloat16: bool = False
    remember: bool = False
    release: Release2022 | None = None
    bucket: int = 256
