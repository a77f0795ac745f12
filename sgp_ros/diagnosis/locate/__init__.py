"""Where a discrepancy is, what it depends on, and the process Z for what has no name."""
