"""Location of a discrepancy, the variables it depends on, and the process Z of unnamed forces."""
