"""Recordings of real machines, and what is known of the machines."""
