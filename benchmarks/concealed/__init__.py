"""Worlds with concealed physics for `sgp diagnose`, drawn by the hundred."""
