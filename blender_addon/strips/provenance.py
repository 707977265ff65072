"""Where a strip's pictures come from, kept on the strip as custom properties."""

import dataclasses
from dataclasses import dataclass
from datetime import UTC, datetime

import bpy

import pe_runtime
from pe_runtime.contract.model_facts import ModelFacts

from ..bake import bake_of
from ..filming.frame_origin import state_digest
from .job import RangeJob, scene_of

JOB_KEY = "playable_environment_job"
PREFIX = "playable_"
START_KEY = "playable_frame_start"
"""The frame at which a job last wanted its strip, wherever the artist has moved it since."""


@dataclass(frozen=True)
class Provenance:
    """What made a strip's pictures.

    Attributes:
        model: The model's name.
        model_digest: SHA-256 of its weights, hex.
        state: SHA-256 of the encoded picture, hex.
        shot: Digest of the baked shot, hex.
        camera: Names of the cameras that filmed.
        quality: exact, balanced or draft.
        version: The add-on's.
        rendered: When the last frame was drawn, ISO 8601 in UTC.
        scene: The scene's name at that time.
    """

    model: str
    model_digest: str
    state: str
    shot: str
    camera: str
    quality: str
    version: str
    rendered: str
    scene: str


def provenance_of(
    scene: bpy.types.Scene, job: RangeJob, facts: ModelFacts, drawn: bool
) -> Provenance:
    """What a scene's job is rendered from.

    Args:
        scene: The scene.
        job: Its job.
        facts: Its model.
        drawn: Whether any frame was drawn just now.
    """
    settings = scene.playable_environment
    bake = bake_of(settings)
    return Provenance(
        model=facts.name,
        model_digest=facts.digest,
        state=state_digest(bake.shot),
        shot=bake.digest,
        camera=", ".join(_cameras(scene, job)),
        quality=settings.quality,
        version=pe_runtime.__version__,
        rendered=datetime.now(UTC).isoformat(timespec="seconds") if drawn else "",
        scene=scene.name,
    )


def note_provenance(strip: bpy.types.Strip, provenance: Provenance) -> None:
    """Write it on a strip."""
    for name, value in dataclasses.asdict(provenance).items():
        # Frames that were up to date keep the time at which they were drawn.
        if value or PREFIX + name not in strip:
            strip[PREFIX + name] = value


def read_provenance(strip: bpy.types.Strip) -> dict[str, str]:
    """What is written on a strip, by name; names that are not there have no entry."""
    names = [each.name for each in dataclasses.fields(Provenance)]
    return {name: str(strip[PREFIX + name]) for name in names if PREFIX + name in strip}


def scene_of_strip(strip: bpy.types.Strip) -> bpy.types.Scene | None:
    """The scene that a strip was rendered from, also after either was renamed."""
    return scene_of(strip.get(JOB_KEY, ""), strip.get(PREFIX + "scene", ""))


def _cameras(scene: bpy.types.Scene, job: RangeJob) -> list[str]:
    switched = (m.camera for m in scene.timeline_markers if m.frame in job.frames)
    return sorted({each.name for each in (scene.camera, *switched) if each is not None})
