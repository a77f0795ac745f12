"""What the comparison lets us assert, with what certainty, and what it cannot tell apart."""
