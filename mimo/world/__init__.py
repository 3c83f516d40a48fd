"""Infant, mobile and rope in MuJoCo, what the eye sees, and the phases of a run; alone, a Gymnasium environment."""
