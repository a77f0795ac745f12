"""Unlisted laws: first a shape without a formula, then the shortest formula for it."""
