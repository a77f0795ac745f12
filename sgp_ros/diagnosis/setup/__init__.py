"""Errors of how a robot was connected, before any physics."""
