"""How the report words numbers: three significant digits, and a unit on everything that has one."""

from __future__ import annotations

import math
from datetime import datetime

_SUPERSCRIPT = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
_SPACE = "\N{NO-BREAK SPACE}"
UNDEFINED = "undefined"
RADIANCE = f"W{_SPACE}sr⁻¹{_SPACE}m⁻²"


def three(value: float) -> str:
    """Word `value` with three significant digits.

    Examples
    --------
    >>> three(0.0123456), three(-1.5), three(99.96), three(12345), three(1.5e-7)
    ('0.0123', '−1.50', '100', '12300', '1.50×10⁻⁷')
    """
    if math.isnan(value):
        return UNDEFINED
    if math.isinf(value):
        return "∞" if value > 0 else "−∞"
    if value == 0:
        return "0"
    mantissa, _, exponent_text = f"{abs(value):.2e}".partition("e")
    exponent = int(exponent_text)
    sign = "−" if value < 0 else ""
    if -4 <= exponent < 6:
        return f"{sign}{float(f'{mantissa}e{exponent}'):.{max(2 - exponent, 0)}f}"
    return f"{sign}{mantissa}×10{str(exponent).translate(_SUPERSCRIPT)}"


def percent(value: float) -> str:
    """Word a fraction in percent: ``percent(0.0123)`` is ``1.23 %``."""
    return three(value) if math.isnan(value) else f"{three(100 * value)}{_SPACE}%"


def ratio(value: float) -> str:
    """Word a value that lies near one, where three significant digits would all be nines: four decimals."""
    return f"{value:.4f}" if math.isfinite(value) and abs(value) < 1e4 else three(value)


def seconds(value: float) -> str:
    """Word a duration with the unit that suits it, from ns to s."""
    return _scaled(value, "s", ((1.0, ""), (1e-3, "m"), (1e-6, "µ"), (1e-9, "n")))


def size(count: int) -> str:
    """Word a number of bytes with decimal prefixes."""
    return _scaled(float(count), "B", ((1e9, "G"), (1e6, "M"), (1e3, "k"), (1.0, "")))


def between(low: str, high: str) -> str:
    """Word a range, its shared unit once: ``between("1.2 ms", "1.3 ms")`` is ``1.2 – 1.3 ms``."""
    number, _, unit = low.partition(_SPACE)
    return f"{number} – {high}" if unit and high.endswith(_SPACE + unit) else f"{low} – {high}"


def moment(iso: str) -> str:
    """Word a time in ISO 8601 to the minute; one that is not is left as it is.

    Examples
    --------
    >>> moment("2025-03-01T10:15:42+00:00")
    '2025-03-01 10:15 UTC'
    """
    try:
        when = datetime.fromisoformat(iso)
    except ValueError:
        return iso
    return f"{when:%Y-%m-%d %H:%M %Z}".strip()


def _scaled(value: float, unit: str, scales: tuple[tuple[float, str], ...]) -> str:
    if not math.isfinite(value) or value == 0:
        return f"{three(value)}{_SPACE}{unit}"
    # .9995: what rounds to 1.00 of a unit takes that unit.
    factor, prefix = next((scale for scale in scales if abs(value) >= 0.9995 * scale[0]), scales[-1])
    return f"{three(value / factor)}{_SPACE}{prefix}{unit}"
