"""Knobs of the action module's training."""

from dataclasses import dataclass, replace

from pe_runtime.config.ablations import ACTION_ROWS
from pe_runtime.config.checks import demand_one_of


@dataclass(frozen=True)
class ActionTrainingConfig:
    """Training of A, R and D on encoded sequences (paper, Sec. 3.4).

    The loss weights suit movements in units of `movement_scale` and poses of unit variance. With a
    much higher `pose_weight`, or lower weights of the two action losses, actions begin to tell
    phases of a pose apart and confuse the first step of a walk with a gesture.
    """

    steps: int = 1000
    batch: int = 64
    """Windows per step, from the sequences of all objects of the class."""
    shortest: int = 6
    """States in the shortest window; each step draws one length for all its windows."""
    longest: int = 12
    longest_move: float = 1.0
    """Metres in one step beyond which a sequence is left out: the box was cut by another object."""
    learning_rate: float = 2e-3
    discriminator_learning_rate: float = 5e-4
    betas: tuple[float, float] = (0.5, 0.9)
    warmup: float = 0.03
    """Share of the training over which the learning rates rise."""
    clip: float = 1.0
    position_weight: float = 1.0
    pose_weight: float = 1.0
    pose_horizon: float = 0.0
    """Steps of a rollout after which a pose's error counts 1/e of what it counts at first; 0: all
    steps count alike."""
    likeness_weight: float = 0.0
    """Of the discrepancy between windows of encoded poses and those that R makes up, in the window
    itself and in steps that go on behind it. It is what keeps legs walking: see `likeness`."""
    likeness_window: int = 4
    """Poses in such a window."""
    likeness_actions: float = 1.0
    """What an action weighs beside a pose code in it."""
    imagined_steps: int = 12
    """Steps that R goes on behind each window, by actions of another sequence."""
    style_weight: float = 0.1
    """Without effect unless R predicts styles."""
    heading_weight: float = 1.0
    """Without effect unless R predicts headings."""
    action_weight: float = 0.15
    joint_memory: float = 0.0
    """Share of the batches before in the joint probabilities of the action loss."""
    movement_weight: float = 0.3
    movement_slack: float = 0.0
    """Added to probabilities and variances of the movement loss, metres squared."""
    movement_frame: str = "model"
    """Whose right and forward the movement loss means: the "model"'s own `movement_frame`, or
    another of the frames that a model can have."""
    dynamics_frame: str = "model"
    """Whose right and forward R's movements mean: what the "model"'s configuration says, or another
    of its `movement_frame`s, which the trained model then has."""
    adversarial_weight: float = 0.01
    variability_weight: float = 0.05
    variability_share: float = 0.5
    """Sequences rebuilt with v; the others with v = 0, as at inference."""
    centroid_rate: float = 0.1
    """How fast the actions' centroids follow each batch; without effect unless A is of the design
    "state"."""
    soft_actions: bool = False
    """R gets mixtures of actions in training, not one of them."""
    given_states: int = 1
    """R steps from so many encoded states before it steps from its own."""
    go_on: bool = False
    """Start from the weights of the model's own actions instead of anew, as far as it has them."""
    fresh_memory: float = 0.5
    """Windows that start with a fresh memory. The others go on with what R remembers of the window
    drawn before, so memories grow older than the sequences are long and long rollouts hold."""
    first_temperature: float = 1.0
    last_temperature: float = 0.3
    first_teacher_forcing: float = 0.8
    last_teacher_forcing: float = 0.0
    seed: int = 0
    log_every: int = 50
    checkpoint_every: int = 250


def ablated_actions(training: ActionTrainingConfig, row: str) -> ActionTrainingConfig:
    """The full training without what a row of the paper's action ablation lacks.

    Raises:
        ConfigError: There is no such row.
    """
    demand_one_of(row, tuple(ACTION_ROWS), "ablation: row")
    has = ACTION_ROWS[row]
    return replace(
        training,
        dynamics_frame=training.dynamics_frame if has.relative else "world",
        adversarial_weight=training.adversarial_weight * has.discriminator,
        movement_weight=training.movement_weight * has.movement_loss,
        action_weight=training.action_weight * has.action_loss,
    )
