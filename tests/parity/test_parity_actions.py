"""Our action module with imported weights against recorded runs of the authors' release.

The recordings are float32 themselves: evaluated in float64 from the very same weights, they differ
by up to 7e-6 where A's embeddings are of size 20. Hence a relative bar for numbers above 10.
"""

import pytest
import torch
from parity.parity_files import check_within, parity_case

from pe_runtime.action.discriminator import TemporalDiscriminator
from pe_runtime.action.dynamics import Control
from pe_runtime.action.module import ActionModule
from pe_runtime.action.sampling import Noise, Sampling
from pe_runtime.action.sequences import PlayerState, StateSequence
from pe_runtime.interop.action_weights import (
    NATIVE_ACTIONS,
    action_entries,
    convert_action_module,
    convert_discriminator,
    discriminator_entries,
)
from pe_runtime.interop.official_entries import official_config
from pe_runtime.training import action_losses as losses

STYLE, POSE = 64, 32
TENNIS = official_config("tennis").action
HEADING = 2
"""Index of the angle about their up axis."""


@pytest.fixture(scope="module")
def case():
    return parity_case("tennis_actions")


def below(tensors, prefix):
    return {n.removeprefix(prefix): t for n, t in tensors.items() if n.startswith(prefix)}


@pytest.fixture(scope="module", params=["float32", "float64"])
def module(case, request):
    module = ActionModule(TENNIS, STYLE, POSE).eval()
    theirs = below(case["state_dict"], "object_animation_models.0.")
    module.load_state_dict(convert_action_module(theirs, TENNIS, NATIVE_ACTIONS["tennis"]))
    return module.to(getattr(torch, request.param))


def inputs_of(part, module):
    kind = module.dynamics.hidden.weight.dtype
    inputs = part["inputs"]
    names = ("translations", "style", "deformation", "rotations")
    return [inputs[name].to(kind) for name in names]


def furthest(found, expected):
    assert found.shape == expected.shape
    return (found.double() - expected.double()).abs().max().item()


class Recorded(Noise):
    """Hands out recorded noise, in order; nothing is left to chance else."""

    def __init__(self, normals, exponentials):
        self.normals, self.exponentials = list(normals), list(exponentials)

    def uniform(self, *shape):
        return torch.full(shape, 0.5)

    def normal(self, like):
        assert like.shape == self.normals[0].shape
        return self.normals.pop(0).to(like)

    def exponential(self, like):
        return self.exponentials.pop(0).to(like)


def test_the_tables_name_exactly_what_their_checkpoint_holds(case):
    shapes = {name: tuple(each.shape) for name, each in case["state_dict"].items()}
    assert below(shapes, "object_animation_models.0.") == action_entries(TENNIS, STYLE, POSE)
    assert below(shapes, "discriminator_models.0.") == discriminator_entries(TENNIS, POSE)


@torch.no_grad()
def test_a_rollout_agrees_at_every_step(case, module):
    part = case["rollout"]
    position, style, pose, angles = inputs_of(part, module)
    now, memory = PlayerState(position, style, pose, angles[:, HEADING]), None
    cameras = torch.eye(3).to(position).expand(len(position), 3, 3)
    variation, outputs = part["inputs"]["variation"].to(position), part["outputs"]
    away = {}
    for t in range(part["inputs"]["actions"].shape[1]):
        actions = torch.nn.functional.one_hot(part["inputs"]["actions"][:, t], 7).to(position)
        memory = memory or module.dynamics.initial_memory(len(position))
        step = module.dynamics(now, Control(actions, variation, cameras), memory)
        now, memory = step.state, step.memory
        found = {
            "translations": now.position,
            "style": now.style,
            "deformation": now.pose,
            "h0": memory.hidden[0],
            "h1": memory.hidden[1],
            "c0": memory.cell[0],
            "c1": memory.cell[1],
        }
        for name, each in found.items():
            away[name] = max(away.get(name, 0.0), furthest(each, outputs[name][:, t]))
        angles = outputs["rotations"][:, t, HEADING]
        away["rotations"] = max(away.get("rotations", 0.0), furthest(now.heading, angles))
    for name, error in away.items():
        check_within(f"rollout in {position.dtype}, {name}", error, 1e-5)


def whole_pass(part, module):
    """A on the encoded states, R on its drawn actions, A again on R's states."""
    position, style, pose, angles = inputs_of(part, module)
    cameras = torch.eye(3).to(position).expand(*position.shape[:2], 3, 3)
    sequence = StateSequence(position, style, pose, cameras, angles[..., HEADING])
    # Every other draw of theirs is of points, which nothing is made of.
    inputs = part["inputs"]
    noise = Recorded(inputs["randn_calls_in_order"][1::2], inputs["exponential_calls_in_order"])
    given = inputs["ground_truth_observations"]
    sampling = Sampling(1.0, 0.0, 1.0, noise, soft=True, given=given)
    rebuilt = module.reconstruct(sequence, sampling)
    return rebuilt, module.action_network(rebuilt.sequence, noise)


@torch.no_grad()
def test_the_whole_pass_agrees(case, module):
    part = case["animation_model_eval"]
    outputs = part["outputs"]
    rebuilt, again = whole_pass(part, module)
    estimate, sequence = rebuilt.estimate, rebuilt.sequence
    moments = torch.stack([estimate.mean, estimate.log_variance], dim=-2)
    moments_again = torch.stack([again.mean, again.log_variance], dim=-2)
    pairs = {
        "action_logits": estimate.logits,
        "action_directions_distribution": moments,
        "sampled_action_directions": estimate.direction,
        "sampled_actions": rebuilt.actions,
        "action_variations": rebuilt.variability,
        "reconstructed_object_translations": sequence.positions,
        "reconstructed_object_style": sequence.styles,
        "reconstructed_object_deformation": sequence.poses,
        "reconstructed_action_logits": again.logits,
        "reconstructed_action_directions_distribution": moments_again,
        "reconstructed_sampled_action_directions": again.direction,
    }
    angles = outputs["reconstructed_object_rotations"][..., HEADING]
    check_within("reconstructed_object_rotations", furthest(sequence.headings, angles), 1e-5)
    for name, found in pairs.items():
        bar = max(1e-5, 1e-6 * outputs[name].abs().max().item())
        what = f"actions in {found.dtype}, {name}"
        check_within(what, furthest(found, outputs[name]), bar)


def test_the_discriminator_agrees(case):
    recorded = case["animation_model_eval"]["discriminator"]
    judge = TemporalDiscriminator(TENNIS, POSE).eval()
    theirs = below(case["state_dict"], "discriminator_models.0.")
    judge.load_state_dict(convert_discriminator(theirs, NATIVE_ACTIONS["tennis"]))
    with torch.no_grad():
        found = judge.judge(recorded["input"], recorded["validity"])
    check_within("discriminator", furthest(found, recorded["output"]), 1e-5)


def test_the_movement_loss_agrees(case):
    recorded = case["animation_model_eval"]["losses"]
    found = losses.soft_delta_mse(recorded["probabilities"], recorded["movements"], slack=1e-4)
    check_within("movement loss", furthest(found, recorded["acmv"]), 1e-6)


def test_two_batches_of_mutual_information_agree(case):
    recorded = case["animation_model_eval"]["losses"]
    p, q = recorded["probabilities"], recorded["probabilities2"]
    joint = torch.full((7, 7), 1 / 49)
    for name, second in (("mi_first_call(p,p2)", q), ("mi_second_call(p,p)", p)):
        joint = losses.joint_probabilities(p, second, joint, 0.8)
        found = -losses.mutual_information(joint)
        check_within(name, furthest(found, recorded[name]), 1e-6)
    check_within("joint matrix", furthest(joint, recorded["mi_matrix_after"]), 1e-6)


def test_the_divergence_agrees_for_actions_and_for_maps(case):
    recorded = case["animation_model_eval"]["losses"]
    mean, log_variance = recorded["kl_in"].unbind(dim=1)
    found = losses.variability_divergence(mean, log_variance)
    check_within("divergence of actions", furthest(found, recorded["kl"]), 1e-6)
    mean, log_variance = recorded["spatial_kl_in"].chunk(2, dim=1)
    found = losses.variability_divergence(mean.movedim(1, -1), log_variance.movedim(1, -1))
    check_within("divergence of maps", furthest(found, recorded["spatial_kl"]), 1e-6)


def test_the_adversarial_losses_agree(case):
    recorded = case["animation_model_eval"]["losses"]
    logits = recorded["gan_in"]
    found = losses.generator_loss(logits)
    check_within("generator loss", furthest(found, recorded["gan_real"]), 1e-6)
    found, both = (
        losses.discriminator_loss(logits, logits),
        recorded["gan_real"] + recorded["gan_fake"],
    )
    check_within("discriminator loss", furthest(found, both), 1e-6)
