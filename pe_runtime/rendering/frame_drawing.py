"""Feature maps of one frame, and of the next: what stands still is not drawn again.

A frame with the camera of the one before composes only the rays that meet something that changed,
where it is now or where it was. Everything else, samples of unchanged objects included, is taken
over. The numbers are those of a fresh frame to the last bit, because no ray's arithmetic depends on
the other rays.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor

from pe_runtime.geometry.cameras import Cameras
from pe_runtime.rendering.frame_composition import (
    Features,
    Level,
    Measures,
    compose_features,
    compose_measures,
)
from pe_runtime.rendering.frame_passages import FrameObject, FramePassage, FrameRays
from pe_runtime.rendering.frame_sampling import frame_passage
from pe_runtime.rendering.scene import RenderSettings

CHUNK = 16384
"""Rays at once where a frame has more than are kept; bounds the memory."""

KEPT_RAYS = 40960
"""Frames of more rays (a picture of 1024x512 has them) are drawn in chunks and not kept."""


@dataclass(frozen=True)
class Placed:
    """One object of a frame and a key that is equal while the object looks the same."""

    key: tuple
    object: FrameObject


@dataclass(frozen=True)
class KeptFrame:
    """What a frame leaves behind for the next one with the same view.

    Attributes:
        view: Key of camera, rays and settings.
        keys: Key of every object, by name.
        passages: Samples of its objects. The next frame takes out what it can use and frees the
            rest before it computes its own, so that there are never two of a kind.
        maps: Feature maps, (rays of the level, channels).
    """

    view: tuple
    keys: Mapping[str, tuple]
    passages: dict[str, FramePassage]
    maps: list[Float[Tensor, "_ _"]]


@dataclass(frozen=True)
class DrawnFeatures:
    """Feature maps of a frame.

    Attributes:
        maps: (rays of the level, channels), finest first, row by row.
        changed: Per level, whether a ray differs from the kept frame's; None without one.
        statistics: Counters: rays, composed_rays, hits, field_samples, feature_samples,
            kept_objects.
        kept: For the next frame; None for frames too large to keep.
    """

    maps: list[Float[Tensor, "_ _"]]
    changed: list[Bool[Tensor, " _"]] | None
    statistics: dict[str, int]
    kept: KeptFrame | None


def draw_features(
    rays: FrameRays,
    levels: Sequence[Level],
    placed: Mapping[str, Placed],
    settings: RenderSettings,
    kept: KeptFrame | None = None,
) -> DrawnFeatures:
    """Draw the feature maps of a frame.

    Args:
        rays: All rays, level after level.
        levels: Which rays and channels each feature map takes.
        placed: The visible objects by name, in the order of the model.
        settings: Sampling and skipping.
        kept: What the frame before left behind; used if its view is this one's, and up.
    """
    view = (camera_key(rays.camera), len(rays), rays.parts, rays.base, settings)
    if kept is not None and kept.view != view:
        kept.passages.clear()
        kept = None
    if len(rays) > KEPT_RAYS:
        return _in_chunks(rays, levels, placed, settings)
    reused, left = _taken(kept, placed)
    passages, fresh = _passages(rays, placed, settings, reused)
    which = _changed_rays(rays, passages, fresh, left)
    seen = compose_features(list(passages.values()), which, levels, settings)
    maps, changed = _merged(which, levels, seen, kept, len(rays))
    statistics = _statistics(len(rays), passages, fresh, which, seen)
    keys = {name: each.key for name, each in placed.items()}
    return DrawnFeatures(maps, changed, statistics, KeptFrame(view, keys, passages, maps))


def camera_key(camera: Cameras) -> tuple:
    """Equal for equal cameras, and for no others."""
    numbers = (camera.intrinsics, camera.world_from_camera)
    return camera.width, camera.height, *(each.cpu().numpy().tobytes() for each in numbers)


def _passages(
    rays: FrameRays,
    placed: Mapping[str, Placed],
    settings: RenderSettings,
    reused: Mapping[str, FramePassage],
) -> tuple[dict[str, FramePassage], set[str]]:
    """Samples of all objects, and the names of those that had to be sampled."""
    passages: dict[str, FramePassage] = {}
    fresh = set()
    for name in _front_first(rays, placed):
        if name in reused:
            passages[name] = reused[name]
            continue
        # With a standing camera those behind are kept while those in front move, so what is hidden
        # now may show later: nothing is left out then.
        before = [] if settings.remember else list(passages.values())
        passages[name] = frame_passage(rays, placed[name].object, settings, before)
        fresh.add(name)
    # Composed in the order of the model, which decides between samples at equal depths.
    return {name: passages[name] for name in placed}, fresh


def _taken(
    kept: KeptFrame | None, placed: Mapping[str, Placed]
) -> tuple[dict[str, FramePassage], list[Tensor] | None]:
    """Samples of the last frame that hold still, and the rays that the others of it met.

    The others themselves are freed. None instead of rays: there is no last frame.
    """
    if kept is None:
        return {}, None
    reused, left = {}, []
    for name in list(kept.passages):
        passage = kept.passages.pop(name)
        if name in placed and kept.keys[name] == placed[name].key:
            reused[name] = passage
        else:
            left.append(passage.rays)
    return reused, left


def _front_first(rays: FrameRays, placed: Mapping[str, Placed]) -> list[str]:
    """Players from near to far, then what surrounds them."""

    def order(name: str) -> tuple[bool, float]:
        each = placed[name].object
        distance = (each.position.double() - rays.camera.centres[0]).norm()
        return each.field.config.kind != "playable", distance.item()

    return sorted(placed, key=order)


def _changed_rays(
    rays: FrameRays,
    passages: Mapping[str, FramePassage],
    fresh: set[str],
    left: Sequence[Tensor] | None,
) -> Int[Tensor, " rays"]:
    device = rays.directions.device
    if left is None:
        return torch.arange(len(rays), device=device)
    changed = torch.zeros(len(rays), dtype=torch.bool, device=device)
    for name in fresh:
        changed[passages[name].rays] = True
    for before in left:
        changed[before] = True
    return torch.nonzero(changed)[:, 0]


def _merged(
    which: Tensor,
    levels: Sequence[Level],
    seen: Features,
    kept: KeptFrame | None,
    count: int,
) -> tuple[list[Tensor], list[Tensor] | None]:
    """Whole maps, and where they differ from the kept ones."""
    if kept is None:
        return seen.levels, None
    mask = torch.zeros(count, dtype=torch.bool, device=which.device)
    mask[which] = True
    maps, changed = [], []
    for level, before, drawn in zip(levels, kept.maps, seen.levels, strict=True):
        own = mask[level.rays]
        whole = before.clone()
        whole[own] = drawn
        maps.append(whole)
        changed.append(own)
    return maps, changed


def _statistics(
    count: int,
    passages: Mapping[str, FramePassage],
    fresh: set[str],
    which: Tensor,
    seen: Features,
) -> dict[str, int]:
    return {
        "rays": count,
        "composed_rays": which.shape[0],
        "hits": sum(passages[name].rays.shape[0] for name in fresh),
        "field_samples": sum(passages[name].evaluated for name in fresh),
        "feature_samples": seen.evaluated,
        "kept_objects": len(passages) - len(fresh),
    }


def _in_chunks(
    rays: FrameRays,
    levels: Sequence[Level],
    placed: Mapping[str, Placed],
    settings: RenderSettings,
) -> DrawnFeatures:
    """A large frame, chunk by chunk, with nothing kept."""
    parts, counts = [], []
    for own, start, stop in _chunks(rays):
        within = [Level(_within(each.rays, start, stop), each.channels) for each in levels]
        passages, which = _sampled(own, placed, settings)
        seen = compose_features(list(passages.values()), which, within, settings)
        parts.append(seen.levels)
        counts.append(_statistics(len(own), passages, set(passages), which, seen))
    maps = [torch.cat(each) for each in zip(*parts, strict=True)]
    totals: dict[str, int] = {}
    for statistics in counts:
        for key, value in statistics.items():
            totals[key] = totals.get(key, 0) + value
    return DrawnFeatures(maps, None, totals, None)


def measure(rays: FrameRays, placed: Mapping[str, Placed], settings: RenderSettings) -> Measures:
    """Depth and shares of all rays, chunk by chunk, with nothing kept.

    Args:
        rays: The rays.
        placed: The visible objects by name, in the order of the model.
        settings: Sampling and skipping.
    """
    parts = []
    for own, _, _ in _chunks(rays):
        passages, which = _sampled(own, placed, settings)
        parts.append(compose_measures(list(passages.values()), which, settings))
    shares, depth = (torch.cat([getattr(p, n) for p in parts]) for n in ("shares", "depth"))
    return Measures(shares, depth)


def _chunks(rays: FrameRays) -> Iterator[tuple[FrameRays, int, int]]:
    """Runs of rays, with the number of the first and one past the last."""
    for start in range(0, len(rays), CHUNK):
        stop = min(start + CHUNK, len(rays))
        run = slice(start, stop)
        parts = (rays.pixels[run], rays.directions[run], rays.lengths[run])
        yield FrameRays(rays.camera, *parts, rays.base, rays.parts), start, stop


def _within(bounds: slice, start: int, stop: int) -> slice:
    """Which of a run's rays lie within bounds."""
    first, last = (min(max(each - start, 0), stop - start) for each in (bounds.start, bounds.stop))
    return slice(first, last)


def _sampled(
    rays: FrameRays, placed: Mapping[str, Placed], settings: RenderSettings
) -> tuple[dict[str, FramePassage], Tensor]:
    """Samples of all objects on a run of rays, and the rays' numbers."""
    passages, _ = _passages(rays, placed, replace(settings, remember=False), {})
    return passages, torch.arange(len(rays), device=rays.directions.device)
