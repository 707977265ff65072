"""What an evaluation reports, for people (a rich table) and for programs (JSON)."""

import json
import math
from typing import Any

from rich.table import Table

FIGURES = {
    "reconstruction_psnr": ("PSNR, recorded view", "dB"),
    "reconstruction_ssim": ("SSIM, recorded view", ""),
    "novel_view_psnr": ("PSNR, second camera", "dB"),
    "novel_view_ssim": ("SSIM, second camera", ""),
    "novel_view_drop": ("PSNR lost at the second camera", "dB"),
    "box_psnr_own_pose": ("PSNR in players' boxes, own pose", "dB"),
    "box_psnr_other_pose": ("PSNR in players' boxes, pose of another frame", "dB"),
    "box_psnr_pose_gap": ("PSNR in players' boxes won by the own pose", "dB"),
    "box_psnr_articulation_gap": ("The same without the shift of the body", "dB"),
    "other_sequence_pose_psnr_gap": (
        "PSNR in players' boxes lost to another sequence's pose",
        "dB",
    ),
    "other_sequence_pose_change": ("Change of colour in players' boxes by that pose", "%"),
    "other_sequence_pose_iou": ("IoU of players' masks before and after that pose", ""),
    "style_swap_iou": ("IoU of players' masks before and after another style", ""),
    "style_swap_silhouette_iou": ("The same of people found in the pictures", ""),
    "style_swap_colour": ("Change of colour on players by that style", "%"),
    "delta_mse": ("Delta-MSE, true positions", "%"),
    "delta_mse_of_true_actions": ("Delta-MSE of the recorder's own actions", "%"),
    "delta_accuracy": ("Delta-Acc, true positions", "%"),
    "delta_accuracy_of_true_actions": ("Delta-Acc of the recorder's own actions", "%"),
    "delta_accuracy_merged": ("Delta-Acc, standing actions as one", "%"),
    "delta_accuracy_merged_of_true_actions": (
        "Delta-Acc of the recorder's own actions, standing ones as one",
        "%",
    ),
    "standing_accuracy": ("True standing actions told apart (chance: 1 / their number)", "%"),
    "action_agreement": ("Mutual information with the true actions (0 to 1)", ""),
    "encoding_error": ("Position error of an encoded frame", "m"),
    "rollout_error": ("Position error, mean over the rollout", "m"),
    "rollout_error_last": ("Position error after the last step", "m"),
    "static_error_last": ("The same if players stood still", "m"),
}
"""Label and unit of each figure, in the order of the table."""


def as_table(report: dict[str, Any]) -> Table:
    """A report of `evaluation.protocol.evaluate` as a table with 95 % intervals."""
    title = f"{report['scene']}: {report['sequences']} sequences, {report['frames']} frames drawn"
    table = Table(title=title)
    table.add_column("figure")
    for heading in ("value", "95 % interval", "unit"):
        table.add_column(heading, justify="right")
    for key, (label, unit) in FIGURES.items():
        figure = report["figures"].get(key)
        if figure is not None:
            interval = f"{number(figure['low'])} .. {number(figure['high'])}"
            table.add_row(label, number(figure["value"]), interval, unit)
    return table


def as_lines(report: dict[str, Any]) -> str:
    """The same table in Markdown."""
    lines = ["| figure | value | 95 % interval | unit |", "| --- | --- | --- | --- |"]
    for key, (label, unit) in FIGURES.items():
        figure = report["figures"].get(key)
        if figure is not None:
            value, low, high = (number(figure[name]) for name in ("value", "low", "high"))
            lines.append(f"| {label} | {value} | {low} .. {high} | {unit} |")
    return "\n".join(lines) + "\n"


def as_json(report: dict[str, Any]) -> str:
    """The report as JSON; what could not be measured (NaN) becomes null."""
    return json.dumps(_without_nan(report), indent=2, allow_nan=False)


def number(value: float) -> str:
    """Three digits behind the point below 10, two above; a dash for what could not be told."""
    return "-" if math.isnan(value) else f"{value:.3f}" if abs(value) < 10 else f"{value:.2f}"


def _without_nan(value: Any) -> Any:  # noqa: ANN401 any JSON value
    if isinstance(value, dict):
        return {key: _without_nan(entry) for key, entry in value.items()}
    if isinstance(value, list):
        return [_without_nan(entry) for entry in value]
    return None if isinstance(value, float) and math.isnan(value) else value
