"""Simulated robots with a known truth, effects that can be added, sensors and controllers."""
