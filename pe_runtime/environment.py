"""The playable environment: encode a picture, step the state, render a frame.

State and memory go in and come out; what is kept between calls only saves work, so undo, scrubbing
and farms that split a shot see exactly what one run in order would have seen.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor

from pe_runtime.action.dynamics import Memory as ObjectMemory
from pe_runtime.action.module import ActionModule
from pe_runtime.action.sequences import PlayerState, StateSequence
from pe_runtime.admission import check_found, check_options, check_picture, check_state
from pe_runtime.checkpoint import fit, load_checkpoint
from pe_runtime.config import ModelConfig, from_dict
from pe_runtime.contract.camera import Camera
from pe_runtime.contract.errors import CheckpointError, ConfigError
from pe_runtime.fair_threads import FairThreads
from pe_runtime.frame_renderer import FrameRenderer
from pe_runtime.geometry.cameras import Cameras
from pe_runtime.kept_frames import Frame, KeptFrames
from pe_runtime.networks import Codes, SynthesisNetworks
from pe_runtime.object_layers import with_layers
from pe_runtime.render_options import RenderOptions
from pe_runtime.rendering.precision import multiplies_bfloat16
from pe_runtime.rendering.regions import Region
from pe_runtime.rendering.scene import RenderSettings
from pe_runtime.state import EnvironmentState, ObjectState

MODELS = Path(__file__).parent / "models"


@dataclass(frozen=True)
class Memory:
    """What the dynamics networks remember, by object name."""

    objects: Mapping[str, ObjectMemory]


class PlayableEnvironment:
    """A trained model with its three verbs.

    Args:
        config: The environment.
        networks: Trained synthesis module, in evaluation mode.
        actions: Trained action module of each playable class; may be empty.
        header: The model file's facts (action names, training, figures).
    """

    def __init__(
        self,
        config: ModelConfig,
        networks: SynthesisNetworks,
        actions: Mapping[str, ActionModule],
        header: Mapping[str, Any],
    ) -> None:
        self.config = config
        self.networks = networks.eval()
        self.renderer = FrameRenderer(self.networks)
        self.kept_frames = KeptFrames()
        self.threads = FairThreads()
        self.actions = {name: module.eval() for name, module in actions.items()}
        self.header = header
        self.device = next(networks.parameters()).device
        self.playable_names = config.playable_names
        self.steps_per_second = config.steps_per_second
        names = header.get("action_names", {})
        classes = {o.name: o.class_name for o in config.objects}
        self.action_names = {n: tuple(names.get(classes[n], ())) for n in self.playable_names}

    @classmethod
    def load(cls, model: str | Path, device: str = "auto") -> "PlayableEnvironment":
        """Load a model file, or a built-in model by name.

        Args:
            model: Path of a .safetensors file, or the name of a built-in model such as "duel".
            device: "cpu", "cuda", or "auto" for the GPU where there is one.

        Raises:
            CheckpointError: No such model, a damaged file, or weights that do not fit.
        """
        if device == "auto":
            device = "cuda" if torch.cuda.is_available() else "cpu"
        header, tensors = load_checkpoint(find_model(model))
        if header.get("kind") not in ("model", "synthesis"):
            raise CheckpointError(
                f"{model} is the state of a training run, not a model; use its model.safetensors"
            )
        config = from_dict(ModelConfig, header.get("config"), f"configuration of {model}")
        networks = SynthesisNetworks(config).to(device)
        _load(networks, tensors, "synthesis.", "the synthesis module")
        actions = {}
        for name, each in config.classes.items():
            if any(key.startswith(f"actions.{name}.") for key in tensors):
                module = ActionModule(config.action, each.style_features, each.pose_features)
                _load(module, tensors, f"actions.{name}.", f"the action module of {name!r}")
                actions[name] = module.to(device)
        return cls(config, networks, actions, header)

    @torch.no_grad()
    def encode(
        self, image: np.ndarray, camera: Camera, boxes: Mapping[str, Sequence[float]]
    ) -> EnvironmentState:
        """Find the state of every object in a picture (encoder E).

        Args:
            image: (height, width, 3) float32 sRGB in [0, 1]; any size.
            camera: The camera that took it, with the picture's pixel grid.
            boxes: Playable object -> (left, top, right, bottom) in pixels. An object without a box
                is not in the picture: it is hidden in the state.

        Raises:
            ConfigError: The picture has NaN pixels or another size than the camera says, or a box
                names an unknown object.
            CameraError: A box has no area, or its foot is no point on the ground.
        """
        check_picture(image, camera)
        unknown = [name for name in boxes if name not in self.playable_names]
        if unknown:
            known = ", ".join(self.playable_names) or "none"
            raise ConfigError(f"box for {unknown[0]!r}, but the playable objects are: {known}")
        width = self.config.width
        height = max(1, round(image.shape[0] * width / image.shape[1]))
        # A copy: pictures may be read-only, as those that come from a file's or a pipe's bytes.
        picture = torch.from_numpy(np.array(image, np.float32, order="C")).permute(2, 0, 1)[None]
        if picture.shape[-2:] != (height, width):
            picture = torch.nn.functional.interpolate(
                picture, (height, width), mode="bilinear", antialias=True
            )
        scale = [width / image.shape[1], height / image.shape[0]] * 2
        own = torch.full((1, len(self.playable_names), 4), torch.nan)
        for name, box in boxes.items():
            box = torch.tensor([float(edge) for edge in box], dtype=torch.float64)
            own[0, self.playable_names.index(name)] = (box * torch.tensor(scale)).float()
        cameras = Cameras.stack([camera.scaled(width, height)], self.device)
        codes = self.networks.encode(picture.to(self.device), cameras, own.to(self.device))
        check_found(codes, boxes, camera)
        return EnvironmentState({name: _state(each) for name, each in codes.items()})

    @torch.no_grad()
    def step(
        self,
        state: EnvironmentState,
        actions: Mapping[str, int],
        camera: Camera,
        memory: Memory | None = None,
    ) -> tuple[EnvironmentState, Memory]:
        """Let objects act for one step (dynamics network R).

        Args:
            state: Where everything is.
            actions: Playable object -> action index. Objects that are not named stay as they are.
            camera: Actions are relative to this camera.
            memory: From the step before; None at the first.

        Raises:
            ConfigError: An unknown object or action, or a state of another model.
            CheckpointError: The model has no trained actions.
        """
        check_state(self.config, state)
        remembered = dict(memory.objects) if memory is not None else {}
        objects = dict(state.objects)
        rotation = torch.tensor(camera.world_from_camera[:3, :3]).float()[None].to(self.device)
        for name, action in actions.items():
            module = self._module(name, action)
            acting = torch.tensor([action], device=self.device)
            before = self._player(state[name])
            result = module.step(before, acting, rotation, remembered.get(name))
            remembered[name] = result.memory
            after = result.state
            objects[name] = ObjectState(
                after.position[0].cpu(),
                # R may predict styles; an object still looks as it was told to look.
                state[name].style,
                after.pose[0].cpu(),
                state[name].visible,
                state[name].heading if after.heading is None else float(after.heading[0]),
            )
        return EnvironmentState(objects), Memory(remembered)

    @torch.no_grad()
    def infer_actions(
        self, states: Sequence[EnvironmentState], cameras: Sequence[Camera]
    ) -> dict[str, np.ndarray]:
        """Which action of each object leads from every state to the next (action network A).

        Args:
            states: Successive states, one model step apart.
            cameras: The cameras that saw them.

        Returns:
            Object name -> action indices, one fewer than there are states.

        Raises:
            ConfigError: No states, not as many cameras as states, or states of another model.
            CheckpointError: The model has no trained actions.
        """
        if not states or len(states) != len(cameras):
            raise ConfigError(
                f"actions are inferred from one camera per state, found {len(states)} states and "
                f"{len(cameras)} cameras"
            )
        for state in states:
            check_state(self.config, state)
        rotations = np.stack([c.world_from_camera[:3, :3] for c in cameras])
        rotations = torch.from_numpy(rotations).float()[None].to(self.device)
        found = {}
        for name in self.playable_names:
            players = [self._player(state[name]) for state in states]
            sequence = StateSequence(
                torch.stack([p.position for p in players], dim=1),
                torch.stack([p.style for p in players], dim=1),
                torch.stack([p.pose for p in players], dim=1),
                rotations,
                torch.stack([p.heading for p in players], dim=1),
            )
            found[name] = self._module(name, 0).infer(sequence)[0].cpu().numpy()
        return found

    @torch.no_grad()
    def render(
        self, state: EnvironmentState, camera: Camera, options: RenderOptions | None = None
    ) -> Frame:
        """Draw a state from a camera.

        Args:
            state: What to draw; hidden objects and objects out of view cost nothing.
            camera: From where, and how many pixels.
            options: Quality, region and further passes.

        Raises:
            ConfigError: Unknown quality, mask or layer, a region outside of the camera's pixels, or
                a state of another model.
        """
        options = options or RenderOptions()
        check_options(options, camera, self.config)
        check_state(self.config, state)
        if options.layers or options.background:
            return with_layers(
                lambda each, asked: self.render(each, camera, asked),
                state,
                options,
                self.playable_names,
            )
        asked = (options.switches, options.region, options.depth, options.masks)
        key = (_decided_by(state), _view(camera), asked)
        kept = self.kept_frames.get(key)
        if kept is not None:
            return kept
        with self.threads.sharing():
            frame = self._drawn(state, camera, options)
        self.kept_frames.keep(key, frame)
        return frame

    def forget(self) -> None:
        """Free what is kept of frames drawn before; the next one is drawn from nothing."""
        self.renderer.forget()
        self.kept_frames.clear()

    def _drawn(self, state: EnvironmentState, camera: Camera, options: RenderOptions) -> Frame:
        quality = options.switches
        settings = RenderSettings(
            near=self.config.near,
            weight_threshold=quality.weight_threshold,
            sample_share=quality.sample_share,
            bfloat16=quality.bfloat16 and multiplies_bfloat16(self.device),
            occupancy=quality.occupancy,
            termination=quality.termination,
            remember=True,
        )
        codes = self.codes(state)
        cameras = Cameras.stack([camera], self.device)
        region = None if options.region is None else Region.from_sizes(*options.region)
        picture, statistics = self.renderer.draw(cameras, codes, settings, region)
        depth, masks = None, {}
        if options.depth or options.masks:
            seen = self.renderer.geometry(cameras, codes, settings, region)
            depth, masks = seen.depth, seen.masks
        nothing = np.zeros(options.size(camera), np.float32)
        return Frame(
            np.ascontiguousarray(picture.permute(1, 2, 0).cpu().numpy()),
            depth.cpu().numpy() if options.depth else None,
            {n: masks[n].cpu().numpy() if n in masks else nothing for n in options.masks},
            statistics | {"kept_frames": 0},
        )

    def _module(self, name: str, action: int) -> ActionModule:
        if name not in self.playable_names:
            known = ", ".join(self.playable_names) or "none"
            raise ConfigError(f"{name!r} is not playable; playable objects: {known}")
        class_name = next(o.class_name for o in self.config.objects if o.name == name)
        if class_name not in self.actions:
            raise CheckpointError(
                f"this model has no actions for {class_name!r} yet; train them with "
                "`pe train actions`"
            )
        if not 0 <= action < self.config.action.actions:
            raise ConfigError(
                f"action {action} of {name!r} is out of range; this model has actions 0 to "
                f"{self.config.action.actions - 1}"
            )
        return self.actions[class_name]

    def _player(self, state: ObjectState) -> PlayerState:
        return PlayerState(
            state.position[None].to(self.device),
            state.style[None].to(self.device),
            state.pose[None].to(self.device),
            torch.tensor([state.heading], dtype=torch.float32, device=self.device),
        )

    def codes(self, state: EnvironmentState) -> dict[str, Codes]:
        """A state as the networks take it: one frame on their device."""
        return {name: self._codes(each) for name, each in state.objects.items()}

    def _codes(self, state: ObjectState) -> Codes:
        player = self._player(state)
        visible = torch.tensor([state.visible], device=self.device)
        heading = player.heading if state.heading else None
        return Codes(player.position, player.style, player.pose, visible, heading)


def _decided_by(state: EnvironmentState) -> tuple:
    """Equal for states that look the same, and for no others."""
    return tuple(
        (
            name,
            *(code.numpy().tobytes() for code in (each.position, each.style, each.pose)),
            each.visible,
            each.heading,
        )
        for name, each in state.objects.items()
    )


def _view(camera: Camera) -> tuple:
    numbers = (camera.intrinsics, camera.world_from_camera)
    return camera.width, camera.height, *(each.tobytes() for each in numbers)


def find_model(model: str | Path) -> Path:
    """The file of a model given by path or by built-in name.

    Raises:
        CheckpointError: There is none; the built-in models are named.
    """
    path = Path(model)
    if path.is_file():
        return path
    builtin = {each.stem: each for each in sorted(MODELS.glob("*.safetensors"))}
    if str(model) in builtin:
        return builtin[str(model)]
    known = ", ".join(builtin) or "none"
    raise CheckpointError(
        f"no model {str(model)!r}: neither a file nor built in ({known}); choose another"
    )


def _load(module: torch.nn.Module, tensors: Mapping[str, Tensor], prefix: str, what: str) -> None:
    own = {n[len(prefix) :]: t for n, t in tensors.items() if n.startswith(prefix)}
    wanted = module.state_dict()
    fit(wanted, own, what)
    module.load_state_dict({name: own[name].to(wanted[name].dtype) for name in wanted})


def _state(codes: Codes) -> ObjectState:
    at, style, pose = codes.position[0], codes.style[0], codes.pose[0]
    heading = 0.0 if codes.heading is None else float(codes.heading[0])
    return ObjectState(at.cpu(), style.cpu(), pose.cpu(), bool(codes.visible[0]), heading)
