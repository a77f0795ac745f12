"""Robots that are connected or described wrongly: drawn, diagnosed, scored."""
