"""Numbers in options, such as those of commands about existing arms."""

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

from armwright.exceptions import SettingsError

if TYPE_CHECKING:
    from armwright.robot.mounting import Mounting


def parse_numbers(option: str, text: str, expected: str, *counts: int) -> list[float]:
    """Parse finite numbers with commas, as many as one of the counts."""
    try:
        numbers = [float(part) for part in text.split(",")]
    except ValueError:
        numbers = []
    if len(numbers) not in counts or not all(map(math.isfinite, numbers)):
        raise SettingsError(f'{option} "{text}": expected {expected}')
    return numbers


def refuse(reason: str, **options: object) -> None:
    """Raise SettingsError if one of these options is given, with the reason after its name and value."""
    for name, value in options.items():
        if value is not None:
            raise SettingsError(f"--{name.replace('_', '-')} {value}{reason}")


def parse_prices(texts: Sequence[str]) -> dict[str, float]:
    """Parse `ur5e=28000`, each of another arm, into prices by name [USD]."""
    prices: dict[str, float] = {}
    for text in texts:
        name, _, price = text.rpartition("=")
        if name in prices:
            raise SettingsError(f"--price: expected one price of {name}, got two")
        try:
            prices[name] = float(price if name else "")
        except ValueError:
            raise SettingsError(f'--price "{text}": expected ARM=USD, such as ur5e=28000') from None
    return prices


def parse_base(text: str | None) -> "Mounting | None":
    """Parse `0.1,0,0.3` or `0.1,0,0.3,90` into a mounting; None for None."""
    from armwright.robot.mounting import Mounting

    if text is None:
        return None
    expected = "three numbers with commas, such as 0,0,0.5 [m], or a fourth, the turn [°]"
    x, y, z, *yaw = parse_numbers("--base", text, expected, 3, 4)
    return Mounting.of((x, y, z, *map(math.radians, yaw)))
