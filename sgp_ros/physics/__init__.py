"""Laws of physics that a robot may have: one value per law."""
