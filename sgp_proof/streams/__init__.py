"""Endless streams: rates, intervals, memory."""
