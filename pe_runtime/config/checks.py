"""How configurations refuse numbers and words that make no sense."""

from collections.abc import Sequence

from pe_runtime.contract.errors import ConfigError


def demand(holds: bool, expected: str) -> None:
    """Refuse a configuration that does not hold what it must.

    Raises:
        ConfigError: `holds` is false.
    """
    if not holds:
        raise ConfigError(f"expected {expected}")


def demand_one_of(value: str, known: Sequence[str], where: str) -> None:
    """Refuse a word that is not among the known ones.

    Raises:
        ConfigError: It is another word.
    """
    demand(value in known, f"{where} one of {', '.join(known)}, not {value!r}")
