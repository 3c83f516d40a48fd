"""Numbers as JSON and CSV carry them, and as people write them."""

import json
import math
from pathlib import Path
from typing import Any

import numpy as np

from mimo.record import artifact

DIGITS = 6  # significant, in JSON and CSV
MISSING = "–"
PACKED = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/"  # digits
LEVELS = len(PACKED) ** 2 - 1


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


def packed(values: np.ndarray) -> dict[str, Any]:
    """An array as `low`, `high` and `text`: its values in C order, in LEVELS equal steps from low to high.

    A value is two base64 digits (PACKED): 0 stands for the least value, LEVELS for the greatest.
    """
    low, high = rounded([float(values.min()), float(values.max())])
    levels = np.rint((values - low) / ((high - low) or 1) * LEVELS).clip(0, LEVELS).astype(int)
    digits = np.frombuffer(PACKED.encode(), np.uint8)[np.stack([levels // 64, levels % 64], axis=-1)]
    return {"low": low, "high": high, "text": digits.tobytes().decode()}


def number(value: float | None, digits: int = 2) -> str:
    """`value` with `digits` decimals, or a dash; a true minus sign, never -0."""
    if value is None:
        return MISSING
    text = f"{value:.{digits}f}"
    if float(text) == 0:
        text = text.lstrip("-")
    return text.replace("-", "−")
