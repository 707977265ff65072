"""Styles as text: `player_1=player_2:0.7`, who looks like whom and how much."""

import difflib
from collections.abc import Mapping, Sequence

from pe_runtime.contract.errors import ShotError
from pe_runtime.contract.shot import StyleMix

FORM = "player_1=player_2:0.7"


def parse_styles(texts: Sequence[str], players: Sequence[str]) -> Mapping[str, StyleMix]:
    """Read who borrows whose style from the first frame on; without a weight all of it.

    Args:
        texts: Each with one or more `;`-separated borrowings.
        players: Who may borrow and lend.

    Raises:
        ShotError: The form is wrong, or a player is unknown.
    """
    styles: dict[str, StyleMix] = {}
    for part in (piece.strip() for text in texts for piece in text.split(";")):
        borrower, equals, lent = (piece.strip() for piece in part.partition("="))
        lender, colon, weight = (piece.strip() for piece in lent.partition(":"))
        share = _share(weight) if colon else 1.0
        if not equals or share is None or borrower in styles:
            raise ShotError(
                f"style: expected {FORM!r}, each player once and a weight from 0 to 1; found "
                f"{part!r}"
            )
        for name in (borrower, lender):
            if name not in players:
                near = difflib.get_close_matches(name, players, n=1)
                hint = f"; did you mean {near[0]!r}?" if near else ""
                raise ShotError(f"style: no player {name!r}, there are {', '.join(players)}{hint}")
        styles[borrower] = StyleMix(1, None, lender, share)
    return styles


def _share(text: str) -> float | None:
    """A number from 0 to 1; None for anything else."""
    try:
        number = float(text)
    except ValueError:
        return None
    return number if 0.0 <= number <= 1.0 else None
