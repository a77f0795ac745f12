"""Whole recordings: signals, filters, fits with all rows, roll-outs."""
