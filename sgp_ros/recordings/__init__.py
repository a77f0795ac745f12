"""Recordings in and out: bags to events, events to MCAP, tables to MCAP."""
