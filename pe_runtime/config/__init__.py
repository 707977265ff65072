"""Every knob of model, training and rendering as frozen dataclasses, read from TOML.

Widths and depths are all here; nothing is derived elsewhere.
"""

from pe_runtime.config.model import ActionConfig, FeatureRendererConfig, ModelConfig
from pe_runtime.config.objects import (
    BendingConfig,
    EncoderConfig,
    FieldConfig,
    ObjectClassConfig,
    ObjectConfig,
)
from pe_runtime.config.reading import as_dict, from_dict, read_toml
from pe_runtime.config.runs import QUALITIES, Quality, SynthesisConfig

__all__ = [
    "QUALITIES",
    "ActionConfig",
    "BendingConfig",
    "EncoderConfig",
    "FeatureRendererConfig",
    "FieldConfig",
    "ModelConfig",
    "ObjectClassConfig",
    "ObjectConfig",
    "Quality",
    "SynthesisConfig",
    "as_dict",
    "from_dict",
    "read_toml",
]
