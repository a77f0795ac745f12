"""Effects that could explain a discrepancy: suspects, fits, the models that compete."""
