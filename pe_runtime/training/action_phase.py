"""Second training phase: discover actions in encoded sequences (paper, Sec. 3.4)."""

import math
from collections.abc import Mapping

import torch
from torch import Tensor, nn

from pe_runtime.action.discriminator import TemporalDiscriminator
from pe_runtime.action.dynamics import Memory, choose_memory
from pe_runtime.action.module import ActionModule, Reconstruction
from pe_runtime.action.movement import movements
from pe_runtime.action.sampling import Noise, Sampling
from pe_runtime.action.sequences import StateSequence
from pe_runtime.checkpoint import fit
from pe_runtime.config import ActionConfig
from pe_runtime.contract.errors import EpisodeError
from pe_runtime.evaluation.motion import normalised_mutual_information
from pe_runtime.training import action_losses as losses
from pe_runtime.training.action_config import ActionTrainingConfig
from pe_runtime.training.action_sequences import ActionDataset, without_jumps
from pe_runtime.training.likeness import discrepancy, pose_windows
from pe_runtime.training.loop import (
    BrokenStepError,
    Log,
    learning_rate_share,
    optimiser_tensors,
    restore_optimiser,
)

MEASURED = 128
"""Training sequences that stand in for held-out ones in measurements when there are none."""


class ActionPhase:
    """A and R against D, on windows of encoded sequences.

    Args:
        data: Training sequences of all objects of the class (their device is used).
        config: Network sizes.
        training: Loss weights and rates.
        held_out: Sequences for measurements; without them some training sequences are measured.

    Raises:
        EpisodeError: No sequence of two or more states is free of jumps.
    """

    def __init__(
        self,
        data: ActionDataset,
        config: ActionConfig,
        training: ActionTrainingConfig,
        held_out: ActionDataset | None = None,
    ) -> None:
        self.config, self.training = config, training
        self.data = without_jumps(data, training.longest_move)
        if len(self.data) == 0 or data.steps < 2:
            raise EpisodeError(
                f"actions need sequences of 2 states or more without a step of over "
                f"{training.longest_move:g} m; none of {len(data)} of {data.steps} states is one"
            )
        self.measured = self.data.first(MEASURED) if held_out is None else held_out
        style, pose = data.styles.shape[1], data.poses.shape[2]
        device = data.positions.device
        with torch.random.fork_rng(devices=[]):
            torch.manual_seed(training.seed)
            self.module = ActionModule(config, style, pose).to(device)
            self.judge = TemporalDiscriminator(config, pose).to(device)
        with torch.no_grad():
            initial = self.module.dynamics.initial_memory(training.batch)
            self.memory = Memory(initial.hidden.clone(), initial.cell.clone())
        self.joint = torch.full((config.actions,) * 2, config.actions**-2.0, device=device)
        self.optimisers = {
            "module": _adam(self.module, training.learning_rate, training.betas),
            "judge": _adam(self.judge, training.discriminator_learning_rate, training.betas),
        }

    def start_from(self, module: Mapping[str, Tensor], judge: Mapping[str, Tensor]) -> None:
        """Go on from weights that were trained before.

        Args:
            module: Tensors of the action module.
            judge: Tensors of D; none for one that starts anew.

        Raises:
            CheckpointError: They belong to networks of other sizes.
        """
        for name, tensors in (("module", module), ("judge", judge)):
            network = self._networks()[name]
            if tensors:
                fit(network.state_dict(), tensors, f"the action {name} to go on from")
                network.load_state_dict(tensors)

    def step(self, progress: float) -> Log:
        """One step of A and R against D, then one of D against them.

        All noise comes from a generator that is seeded from torch's global one, so the loop's
        seeding of every step decides it.

        Raises:
            BrokenStepError: A loss or a gradient is not finite; the side that it belongs to keeps
                its weights.
        """
        training = self.training
        generator = torch.Generator().manual_seed(int(torch.randint(2**62, ())))
        sampling = self._sampling(progress, generator)
        share = learning_rate_share(progress, training.warmup)
        lengths = (min(training.shortest, training.longest), training.longest + 1)
        length = int(torch.randint(*lengths, (), generator=generator))
        encoded = self.data.sample(generator, training.batch, length)
        self.judge.requires_grad_(False)
        rebuilt = self.module.reconstruct(encoded, sampling, self._memory(generator))
        self.memory = Memory(rebuilt.memory.hidden.detach(), rebuilt.memory.cell.detach())
        loss, figures = self._module_loss(encoded, rebuilt, sampling.noise)
        self._descend("module", loss, training.learning_rate * share, encoded)
        self.judge.requires_grad_(True)
        real = self._judged(encoded, rebuilt)
        fake = self._judged(rebuilt.sequence.detach(), rebuilt)
        loss = losses.discriminator_loss(real, fake)
        self._descend("judge", loss, training.discriminator_learning_rate * share, encoded)
        return figures | {"discriminator": loss.item()}

    def _sampling(self, progress: float, generator: torch.Generator) -> Sampling:
        training = self.training
        return Sampling(
            _between(training.first_temperature, training.last_temperature, progress),
            _between(training.first_teacher_forcing, training.last_teacher_forcing, progress),
            training.variability_share,
            Noise(generator),
            training.soft_actions,
            training.given_states,
            training.centroid_rate,
        )

    def _judged(self, sequence: StateSequence, rebuilt: Reconstruction) -> Tensor:
        """D's logits of a sequence, encoded or rebuilt, in which A drew the rebuilt one's actions.

        Both kinds are judged beside the same actions, so that these cannot tell them apart.
        """
        return self.judge(sequence, rebuilt.actions, rebuilt.estimate.direction)

    def _memory(self, generator: torch.Generator) -> Memory:
        """Where R starts: fresh, or with the memory that the last windows left behind."""
        fresh = torch.rand(self.training.batch, generator=generator) < self.training.fresh_memory
        initial = self.module.dynamics.initial_memory(self.training.batch)
        return choose_memory(fresh.to(initial.hidden.device), initial, self.memory)

    def _module_loss(
        self, encoded: StateSequence, rebuilt: Reconstruction, noise: Noise
    ) -> tuple[Tensor, Log]:
        training, estimate = self.training, rebuilt.estimate
        again = self.module.action_network(rebuilt.sequence, noise)
        seen_again = again.probabilities.flatten(0, 1)
        seen = estimate.probabilities.flatten(0, 1)
        joint = losses.joint_probabilities(seen, seen_again, self.joint, training.joint_memory)
        self.joint = joint.detach()
        scale, slack = self.config.movement_scale, training.movement_slack
        terms = {
            "position": losses.position_loss(rebuilt.sequence, encoded, scale),
            "pose": losses.code_loss(rebuilt.sequence.poses, encoded.poses, training.pose_horizon),
            "style": losses.code_loss(rebuilt.sequence.styles, encoded.styles),
            "action": -losses.mutual_information(joint),
            "movement": losses.soft_delta_mse(seen, self._moves(encoded), slack),
            "adversarial": losses.generator_loss(self._judged(rebuilt.sequence, rebuilt)),
            "variability": losses.variability_divergence(estimate.mean, estimate.log_variance),
        }
        if training.likeness_weight > 0:
            terms["likeness"] = self._likeness(encoded, rebuilt, noise)
        if self.config.predict_heading:
            terms["heading"] = losses.heading_loss(rebuilt.sequence.facings, encoded.facings)
        total = sum(getattr(training, f"{name}_weight") * term for name, term in terms.items())
        return total, {"loss": total.item()} | {name: term.item() for name, term in terms.items()}

    def _likeness(self, encoded: StateSequence, rebuilt: Reconstruction, noise: Noise) -> Tensor:
        """How differently R's poses are distributed, in the windows and in steps behind them."""
        training, actions = self.training, rebuilt.actions.detach()
        steps = encoded.poses.shape[1]
        # Another sequence's actions, as often as it takes; so also actions that do not follow.
        order = torch.arange(training.imagined_steps, device=actions.device) % max(steps - 1, 1)
        further = actions.roll(1, 0)[:, order]
        cameras = encoded.world_from_camera[:, torch.cat([order, order[-1:]])]
        last = rebuilt.sequence.at(steps - 1)
        imagined = self.module.go_on(last, further, cameras, rebuilt.memory)
        shape = training.likeness_window, training.likeness_actions
        real = pose_windows(encoded.poses, actions, *shape)
        made = pose_windows(rebuilt.sequence.poses, actions, *shape)
        beyond = pose_windows(imagined.poses, further, *shape)
        return discrepancy(real, made, noise) + discrepancy(real, beyond, noise)

    def _moves(self, sequence: StateSequence) -> Tensor:
        """The sequence's movements as the movement loss sees them, (moves 2) metres."""
        frame = self.training.movement_frame
        axes = sequence.axes(self.config.movement_frame if frame == "model" else frame)
        return movements(sequence.positions, axes).flatten(0, 1)

    def _descend(self, name: str, loss: Tensor, rate: float, batch: StateSequence) -> None:
        optimiser, network = self.optimisers[name], self._networks()[name]
        for group in optimiser.param_groups:
            group["lr"] = rate
        optimiser.zero_grad(set_to_none=True)
        loss.backward()
        norm = nn.utils.clip_grad_norm_(network.parameters(), self.training.clip)
        figures = {f"{name} loss": loss.item(), f"{name} gradient": norm.item()}
        if not all(math.isfinite(each) for each in figures.values()):
            raise BrokenStepError(figures, _evidence(batch))
        optimiser.step()

    @torch.no_grad()
    def evaluate(self) -> Log:
        """Roll out the measured sequences from their first states and inferred actions.

        Returns:
            Mean distance at the last step from the encoded position (metres), pose error, share of
            the encoded movements' variance that the actions leave unexplained, and the agreement
            with the true actions where they are known.
        """
        sequence = self.measured.sequences()
        actions = self.module.infer(sequence)
        played = self.module.play(sequence.at(0), actions, sequence.world_from_camera)
        away = (played.positions - sequence.positions)[:, -1].norm(dim=-1)
        moves = self._moves(sequence)
        chosen = nn.functional.one_hot(actions.flatten(), self.config.actions).to(moves)
        figures = {
            "rollout_distance": away.mean().item(),
            "rollout_pose": losses.code_loss(played.poses, sequence.poses).item(),
            "unexplained_movement": losses.soft_delta_mse(chosen, moves).item(),
        }
        if self.measured.true_actions is not None:
            pair = (actions, self.measured.true_actions)
            pair = [each.flatten().cpu().numpy() for each in pair]
            figures["agreement"] = normalised_mutual_information(*pair)
        return figures

    def tensors(self) -> dict[str, Tensor]:
        """Weights and optimisers of both sides, and what is remembered from batch to batch."""
        tensors = self._remembered()
        for name, network in self._networks().items():
            tensors |= {f"{name}.{key}": each for key, each in network.state_dict().items()}
            tensors |= optimiser_tensors(self.optimisers[name], f"optimiser_{name}")
        return tensors

    def restore(self, tensors: Mapping[str, Tensor]) -> None:
        """Take back what `tensors` gave.

        Raises:
            CheckpointError: It belongs to networks or batches of other sizes.
        """
        memory = {n: t for n, t in tensors.items() if n.startswith("memory.")}
        fit(self._remembered(), memory, "the action phase's memory")
        self.memory = Memory(memory["memory.hidden"], memory["memory.cell"])
        self.joint = memory.get("memory.joint", self.joint)
        for name, network in self._networks().items():
            prefix = f"{name}."
            own = {n[len(prefix) :]: t for n, t in tensors.items() if n.startswith(prefix)}
            fit(network.state_dict(), own, f"the action phase's {name}")
            network.load_state_dict(own)
            restore_optimiser(self.optimisers[name], tensors, f"optimiser_{name}")

    def _remembered(self) -> dict[str, Tensor]:
        tensors = {"memory.hidden": self.memory.hidden, "memory.cell": self.memory.cell}
        joint = {"memory.joint": self.joint} if self.training.joint_memory > 0 else {}
        return tensors | joint

    def _networks(self) -> dict[str, nn.Module]:
        return {"module": self.module, "judge": self.judge}


def _evidence(batch: StateSequence) -> dict[str, Tensor]:
    """A batch as tensors to be stored."""
    kept = {name: each for name, each in vars(batch).items() if each is not None}
    return {name: each.detach().contiguous() for name, each in kept.items()}


def _adam(network: nn.Module, rate: float, betas: tuple[float, float]) -> torch.optim.Adam:
    return torch.optim.Adam(network.parameters(), rate, betas)


def _between(first: float, last: float, share: float) -> float:
    return first + (last - first) * share
