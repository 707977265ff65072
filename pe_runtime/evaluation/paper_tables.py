"""Tables in the paper's layout, for people (rich), for documents (Markdown) and programs (JSON)."""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from rich.table import Table

from pe_runtime.config.ablations import ACTION_ROWS, SYNTHESIS_ROWS
from pe_runtime.evaluation.comparison import LONG_PLAY_TABLE
from pe_runtime.evaluation.long_play import LONG_PLAY_FIGURES
from pe_runtime.evaluation.paper_figures import COLUMNS, STAND_INS
from pe_runtime.evaluation.tables import as_json, number

SYNTHESIS_TICKS = {"multi": "Multi", "pose": "π", "style": "w", "renderer": "F"}
ACTION_TICKS = {
    "relative": "Rel.",
    "discriminator": "D",
    "movement_loss": "L_Δ",
    "action_loss": "L_act",
}
TICK = "✓"
ABLATIONS: Mapping[str, tuple[Mapping[str, Any], Mapping[str, str]]] = {
    "ablation-synthesis": (SYNTHESIS_ROWS, SYNTHESIS_TICKS),
    "ablation-actions": (ACTION_ROWS, ACTION_TICKS),
}
"""Rows of the paper's ablations, and what is ticked in them: attribute and heading."""


def headings_and_rows(
    table: str, rows: Mapping[str, Mapping[str, Any]]
) -> tuple[list[str], list[list[str]]]:
    """A table's text: headings, and one list of cells for each row.

    Args:
        table: One of `comparison.TABLES`.
        rows: As `comparison.measure_rows` returns them.
    """
    if table == LONG_PLAY_TABLE:
        headings = ["figure", *rows, "unit"]
        return headings, [
            [label, *(_with_interval(row["figures"].get(key)) for row in rows.values()), unit]
            for key, (label, unit) in LONG_PLAY_FIGURES.items()
        ]
    known, ticks = ABLATIONS.get(table, ({}, {}))
    shown = [k for k in COLUMNS if any(k in row["figures"] for row in rows.values())]
    headings = ["Var." if ticks else "", *ticks.values(), *(COLUMNS[k].heading for k in shown)]
    body = []
    for name, row in rows.items():
        cells = [_tick(known.get(name), attribute) for attribute in ticks]
        figures = [_value(row["figures"].get(key)) for key in shown]
        body.append([row_label(name, known.get(name)), *cells, *figures])
    return headings, body


def row_label(name: str, ablation: Any) -> str:  # noqa: ANN401 a row of either ablation, or None
    """`(b) multi` for a row of the paper with a letter of its own."""
    letter = getattr(ablation, "letter", "")
    return name if not letter or letter.lower() == name else f"({letter}) {name}"


def as_rich(table: str, rows: Mapping[str, Mapping[str, Any]], title: str) -> Table:
    """A table for the terminal."""
    headings, body = headings_and_rows(table, rows)
    view = Table(title=title)
    for index, heading in enumerate(headings):
        view.add_column(heading, justify="right" if index else "left")
    for cells in body:
        view.add_row(*cells)
    return view


def as_markdown(report: Mapping[str, Any]) -> str:
    """All tables of a report with what one has to know to read them."""
    lines = [f"# {report['scene']}: {report['sequences']} sequences", ""]
    lines += [
        f"Protocol {report['protocol']['hash']}, detector `{report['detector']}`; in the long-play "
        "table brackets hold 95 % intervals over sequences, those of all other figures are in "
        "report.json.",
        "",
    ]
    for table, rows in report["tables"].items():
        headings, body = headings_and_rows(table, rows)
        lines += [f"## {table}", "", _line(headings), _line(["---"] * len(headings))]
        lines += [_line(cells) for cells in body]
        lines += ["", *notes(table, rows), ""]
    return "\n".join(lines).rstrip() + "\n"


def notes(table: str, rows: Mapping[str, Mapping[str, Any]]) -> list[str]:
    """Lines under a table: what stand-ins are, units, and what a row could not do."""
    found = [f"{name}: {row['note']}" for name, row in rows.items() if row["note"]]
    if table != LONG_PLAY_TABLE:
        used = {key for row in rows.values() for key in row["figures"]}
        found += [text for key, text in STAND_INS.items() if key in used]
        units = [f"{c.heading[:-1]} in {c.unit}" for k, c in COLUMNS.items() if k in used & _UNITS]
        found += ["; ".join(units)] if units else []
    return found


def write_report(report: Mapping[str, Any], folder: str | Path) -> None:
    """Write FOLDER/report.json and FOLDER/table.md."""
    write_texts(folder, {"report.json": as_json(dict(report)), "table.md": as_markdown(report)})


def write_texts(folder: str | Path, texts: Mapping[str, str]) -> None:
    """Write small files into a folder, each whole or not at all."""
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    for name, text in texts.items():
        unfinished = folder / f".{name}.part"
        unfinished.write_text(text.rstrip() + "\n", encoding="utf-8")
        unfinished.replace(folder / name)


_UNITS = {key for key, column in COLUMNS.items() if column.unit}


def _line(cells: Sequence[str]) -> str:
    return "| " + " | ".join(cells) + " |"


def _tick(row: Any, attribute: str) -> str:  # noqa: ANN401 a row of either ablation, or None
    has = getattr(row, attribute, "")
    return {"x": TICK, True: TICK, "~": "~"}.get(has, "")


def _value(figure: Mapping[str, Any] | None) -> str:
    return "-" if figure is None else number(figure["value"])


def _with_interval(figure: Mapping[str, Any] | None) -> str:
    if figure is None or math.isnan(figure["value"]):
        return "-"
    return f"{number(figure['value'])} [{number(figure['low'])}, {number(figure['high'])}]"
