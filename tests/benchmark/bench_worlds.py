"""Tiny worlds in both quadratures, with everything that a state can ask of a renderer."""

from dataclasses import replace

from small_world import BACKDROP, GROUND, SKY, random_codes, small_config, small_environment

from pe_runtime.config import FeatureRendererConfig
from pe_runtime.state import EnvironmentState, ObjectState

RELEASED = {"quadrature": "release-2022", "native_up": "y", "near": 0.5}
PAPER = FeatureRendererConfig(
    design="paper", strides=(2, 4), features=(5, 4), widths=(8, 8), output_widths=(8,), blocks=2
)


def interval_world(**player):
    """Opaque ground and backdrop, a sky, two dense bending players."""
    config = small_config(**player)
    return small_environment(_denser(config), actions=False)


def released_world(carve=False, design=PAPER):
    """The same in the authors' quadrature, with their F; players stand knee-deep in the ground."""
    config = _denser(small_config(depth_range=(0.5, 30.0)))
    field = replace(GROUND.field, density="relu", density_scale=4.0)
    soft = {"opaque": False, "samples": 4, "depth_range": (0.5, 30.0), "field": field}
    classes = config.classes | {
        "ground": replace(GROUND, low=(-5.0, -5.0, -0.5), high=(5.0, 4.0, 0.4), **soft),
        "backdrop": replace(BACKDROP, high=(5.0, 0.5, 1.5), **soft),
        "sky": replace(SKY, sees_origin=True, depth_range=(40.0, 50.0)),
    }
    released = replace(
        config, classes=classes, carve_overlaps=carve, feature_renderer=design, **RELEASED
    )
    return small_environment(released, actions=False)


def state_of(environment, headings=(0.0, 0.0), hidden=()):
    """Both players where they stand close together, one before the other."""
    codes = random_codes(environment.config, places=((-0.3, 0.3, 0.0), (0.2, -0.4, 0.0)))
    turns = dict(zip(environment.playable_names, headings, strict=True))
    return EnvironmentState(
        {
            name: ObjectState(
                each.position[0],
                each.style[0],
                each.pose[0],
                name not in hidden,
                turns.get(name, 0.0),
            )
            for name, each in codes.items()
        }
    )


def _denser(config):
    player = config.classes["player"]
    player = replace(player, field=replace(player.field, density_scale=25.0))
    return replace(config, classes={**config.classes, "player": player})
