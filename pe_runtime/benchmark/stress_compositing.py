"""Stress of what happens along a ray: sample places, thicknesses, weights, composition."""

import numpy as np
import torch
from torch import Tensor

from pe_runtime.benchmark.stress_cases import (
    Case,
    Outcome,
    Spread,
    Trial,
    compare,
    finite,
    one_of,
    worst,
)
from pe_runtime.benchmark.stress_reference import (
    as_array,
    as_tensor,
    behind,
    gaps_of,
    walked_gradients,
    walked_weights,
)
from pe_runtime.rendering.compositing import composite
from pe_runtime.rendering.release_2022 import LAST_GAP, place_samples, thickness_to_next
from pe_runtime.rendering.sampling import sample_intervals

RAYS = 6
FAINTEST = 1e-30
"""Added to units, so that results below what float32 can hold are not asked for digits."""
DEEPEST = 1e3
"""Optical depth beyond which nothing is left in any precision."""
DENSEST = 1e250
"""Stands for an infinite density in float64, so that products with distances are numbers."""

SAMPLES = Spread((1.0, 2.0, 64.0, 4096.0), "whole")
DENSITIES = Spread((0.0, 1e-30, 1e-8, 1.0, 1e10, 1e30, float("inf")))
SCALES = Spread((1e-3, 1.0, 1e6))
PLACES = ("even", "jittered")


def subtracting(thickness: Tensor) -> Tensor:
    """Weights with a broken transmittance: the sum up to a sample, minus the sample.

    What a huge thickness swallowed in the sum does not come back when it is subtracted again.
    """
    transmittance = torch.exp(-(torch.cumsum(thickness, dim=-1) - thickness))
    return transmittance * -torch.expm1(-thickness)


def mixed_densities(trial: Trial, generator: torch.Generator, samples: int) -> Tensor:
    """Thin, ordinary and empty samples, with some of the trial's density between them."""
    shape = (RAYS, samples)
    usual = torch.rand(shape, generator=generator, dtype=torch.float64) * 4 / samples
    strange = torch.rand(shape, generator=generator) < 0.2
    strange[0, -1] = True
    drawn = torch.where(strange, trial["density"], usual)
    empty = torch.rand(shape, generator=generator) < 0.2
    return torch.where(empty & ~strange, 0.0, drawn).to(trial.dtype)


def weigh_intervals(trial: Trial) -> Outcome:
    """Weights from thicknesses that are given ("interval")."""
    thickness = mixed_densities(trial, trial.generator(), trial.count("samples"))
    thickness.requires_grad_()
    return _weighed(trial, trial.weigh(thickness), thickness, as_array(thickness), 1.0)


def weigh_to_next(trial: Trial) -> Outcome:
    """Weights from densities and the distances between samples ("release-2022")."""
    generator, samples = trial.generator(), trial.count("samples")
    density = mixed_densities(trial, generator, samples).float() / trial["scale"]
    density = density.to(trial.dtype).requires_grad_()
    reach = torch.rand(RAYS, samples, generator=generator) * 10 * trial["scale"]
    # Samples of objects that a ray misses all lie in one place.
    depth = torch.where(reach < 2 * trial["scale"], trial["scale"], reach).sort(dim=1).values
    weights = trial.weigh(thickness_to_next(depth, density))
    gaps = gaps_of(as_array(depth), LAST_GAP)
    # A sample that extends over nothing is nothing, however dense.
    exact = as_array(density).clip(max=DENSEST) * gaps
    return _weighed(trial, weights, density, exact, gaps)


def _weighed(
    trial: Trial, weights: Tensor, inputs: Tensor, exact: np.ndarray, slope: np.ndarray | float
) -> Outcome:
    """Compare weights, and the gradient of a sum of them, with a walk along the rays.

    Args:
        trial: What is tried.
        weights: What came out.
        inputs: What they were made of.
        exact: The thicknesses, float64.
        slope: How much thickness a unit of the inputs is.
    """
    wanted, light = walked_weights(exact)
    depth = 1 + _before(exact)
    forward = compare(
        weights, as_tensor(wanted), as_tensor(wanted * depth + FAINTEST), 4 * trial.epsilon
    )
    towards = torch.rand(weights.shape, generator=trial.generator(), dtype=torch.float64) * 2 - 1
    towards = towards.to(trial.dtype)
    (slopes,) = torch.autograd.grad((weights * towards).sum(), inputs)
    pulls = as_array(towards)
    gradient = walked_gradients(exact, pulls) * slope
    sizes = np.abs(pulls) * light * depth + behind(np.abs(pulls) * wanted * depth)
    backward = compare(
        slopes,
        as_tensor(gradient),
        as_tensor((sizes + FAINTEST) * slope + FAINTEST),
        4 * trial.epsilon,
    )
    return Outcome(forward, backward)


def _before(thickness: np.ndarray) -> np.ndarray:
    """Optical depth in front of every sample, as far as anything is left there."""
    shifted = np.concatenate([np.zeros_like(thickness[:, :1]), thickness[:, :-1]], axis=1)
    return np.minimum(shifted.clip(max=DEEPEST).cumsum(axis=1), DEEPEST)


def compose_objects(trial: Trial) -> Outcome:
    """Unsorted samples of objects that overlap and tie ("interval")."""
    depth, thickness = _unsorted(trial)
    return _composed(trial, composite(depth, thickness), depth, thickness)


def compose_released(trial: Trial) -> Outcome:
    """The same where neighbours decide how far a sample reaches ("release-2022")."""
    depth, thickness = _unsorted(trial)
    weights = composite(depth, thickness, thickness_to_next)
    return _composed(trial, weights, depth, thickness, LAST_GAP)


def _unsorted(trial: Trial) -> tuple[Tensor, Tensor]:
    generator, samples = trial.generator(), trial.count("samples")
    # Few different depths, so that ties are many.
    depth = torch.randint(1, samples + 2, (RAYS, samples), generator=generator).float()
    thickness = mixed_densities(trial, generator, samples).requires_grad_()
    return depth * trial["scale"], thickness


def _composed(
    trial: Trial, weights: Tensor, depth: Tensor, thickness: Tensor, last: float | None = None
) -> Outcome:
    (slopes,) = torch.autograd.grad(weights.sum(), thickness)
    order = np.argsort(as_array(depth), axis=1, kind="stable")
    exact = np.take_along_axis(as_array(thickness), order, axis=1)
    gaps = np.ones_like(exact)
    if last is not None:
        gaps = gaps_of(np.take_along_axis(as_array(depth), order, axis=1), last)
    exact = exact.clip(max=DENSEST) * gaps
    wanted, light = walked_weights(exact)
    unit = wanted * (1 + _before(exact)) + FAINTEST
    places = torch.from_numpy(order)
    forward = compare(
        weights.gather(1, places), as_tensor(wanted), as_tensor(unit), 4 * trial.epsilon
    )
    gradient = walked_gradients(exact, np.ones_like(exact)) * gaps
    sizes = (light * (1 + _before(exact)) + behind(unit) + FAINTEST) * gaps + FAINTEST
    backward = compare(
        slopes.gather(1, places), as_tensor(gradient), as_tensor(sizes), 4 * trial.epsilon
    )
    return Outcome(forward, backward)


def place_in_intervals(trial: Trial) -> Outcome:
    """Samples of passages that are short, long, near and far ("interval")."""
    near, far, jitter = _passages(trial)
    depth, step = sample_intervals(near, far, jitter.shape[1], jitter)
    first, last = near.detach().double(), far.detach().double()
    shares = torch.arange(jitter.shape[1], dtype=torch.float64) + jitter.double()
    exact = first[:, None] + (last - first)[:, None] * shares / jitter.shape[1]
    unit = last[:, None].expand_as(exact)
    forward = worst(
        [
            compare(depth, exact, unit, 4 * trial.epsilon),
            compare(step, (last - first) / jitter.shape[1], last, 4 * trial.epsilon),
        ]
    )
    return Outcome(forward, finite(*torch.autograd.grad(depth.sum() + step.sum(), (near, far))))


def place_evenly(trial: Trial) -> Outcome:
    """Samples from the first crossing to the last, both included ("release-2022")."""
    near, far, jitter = _passages(trial)
    count = jitter.shape[1]
    jittered = PLACES[trial.count("places")] == "jittered"
    depth = place_samples(near, far, count, jitter if jittered else None)
    first, last = near.detach().double()[:, None], far.detach().double()[:, None]
    exact = first + (last - first) * torch.arange(count).double() / max(count - 1, 1)
    if jittered and count > 1:
        middles = (exact[:, 1:] + exact[:, :-1]) / 2
        lower = torch.cat([exact[:, :1], middles], dim=1)
        exact = lower + jitter.double() * (torch.cat([middles, exact[:, -1:]], dim=1) - lower)
    forward = compare(depth, exact, last.expand_as(exact), 4 * trial.epsilon)
    return Outcome(forward, finite(*torch.autograd.grad(depth.sum(), (near, far))))


def _passages(trial: Trial) -> tuple[Tensor, Tensor, Tensor]:
    """Entries, exits and the places of samples in their intervals."""
    generator, samples = trial.generator(), trial.count("samples")
    near = trial["scale"] * 10 ** torch.empty(RAYS).uniform_(-2, 5, generator=generator).double()
    far = near * (1 + trial["length"] * torch.rand(RAYS, generator=generator).double())
    jitter = torch.full((RAYS, samples), 0.5, dtype=trial.dtype)
    if PLACES[trial.count("places")] == "jittered":
        jitter = torch.rand(RAYS, samples, generator=generator).to(trial.dtype)
    near, far = near.to(trial.dtype), far.to(trial.dtype)
    return near.requires_grad_(), far.requires_grad_(), jitter


_PASSAGES = {
    "scale": SCALES,
    "length": Spread((0.0, 1e-12, 1.0, 1e6)),
    "samples": SAMPLES,
    "places": one_of(PLACES),
}
_WEIGHTS = "4 eps of a weight times 1 + the optical depth before it, which exp() magnifies"
_DEPTHS = "4 eps of the exit's depth: places are sums of depths"

COMPOSITING = (
    Case(
        "weights from thickness, interval",
        {"density": DENSITIES, "samples": SAMPLES},
        weigh_intervals,
        _WEIGHTS,
    ),
    Case(
        "weights from densities, release-2022",
        {"density": DENSITIES, "samples": SAMPLES, "scale": SCALES},
        weigh_to_next,
        _WEIGHTS,
    ),
    Case(
        "objects that overlap and tie, interval",
        {"density": DENSITIES, "samples": SAMPLES, "scale": SCALES},
        compose_objects,
        _WEIGHTS,
    ),
    Case(
        "objects that overlap and tie, release-2022",
        {"density": DENSITIES, "samples": SAMPLES, "scale": SCALES},
        compose_released,
        _WEIGHTS,
    ),
    Case("places of samples, interval", _PASSAGES, place_in_intervals, _DEPTHS),
    Case("places of samples, release-2022", _PASSAGES, place_evenly, _DEPTHS),
)
WEIGHING = COMPOSITING[:2]
"""Cases that go by the trial's own way to weigh."""
