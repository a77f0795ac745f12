"""Streams that never end: rates, intervals, memory."""
