"""Identification of whole recordings: both directions of time are at hand."""
