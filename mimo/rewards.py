"""Placeholder, replaced shortly."""

REWARDS = {"mtl": None, "rtl": None, "cais": None, "surprise": None}
