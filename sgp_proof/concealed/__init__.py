"""Robots with concealed physics: drawn, diagnosed, scored."""
