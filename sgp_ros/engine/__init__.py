"""The online engine: a pure fold over an ordered stream of stamped samples."""
