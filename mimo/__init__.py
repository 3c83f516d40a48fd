"""From kicking to causality: an infant model under a mobile, its learning, and its intrinsic rewards."""

from mimo.record import runtime

runtime.prepare()
