"""Effects that could explain a discrepancy: candidates, fits, comparison of models."""
