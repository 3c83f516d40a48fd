"""Numbers as JSON and CSV carry them, and as people write them."""

import json
import math
from pathlib import Path
from typing import Any

from mimo.record import artifact

DIGITS = 6  # significant, in JSON and CSV
MISSING = "–"


def rounded(value: Any, digits: int = DIGITS) -> Any:
    """`value` with every float in it cut to `digits` significant digits; -0.0 becomes 0.0, what is no number None."""
    if isinstance(value, float):
        return float(f"{value:.{digits}g}") + 0.0 if math.isfinite(value) else None
    if isinstance(value, dict):
        return {key: rounded(item, digits) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [rounded(item, digits) for item in value]
    return value


def write(found: dict[str, Any], path: Path, digits: int = DIGITS) -> None:
    """Publish `found` as JSON, rounded."""
    text = json.dumps(rounded(found, digits), indent=2, ensure_ascii=False, allow_nan=False)
    artifact.publish(f"{text}\n".encode(), path)


def number(value: float | None, digits: int = 2) -> str:
    """`value` with `digits` decimals, or a dash; a true minus sign, never -0."""
    if value is None:
        return MISSING
    text = f"{value:.{digits}f}"
    if float(text) == 0:
        text = text.lstrip("-")
    return text.replace("-", "−")
