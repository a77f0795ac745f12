"""Measured promises of `sgp campaign`: wear found under warm-up, false alarms, lost workers."""
