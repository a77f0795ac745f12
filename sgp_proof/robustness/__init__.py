"""Fuzzers by seed: events, files and kills."""
