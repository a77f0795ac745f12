"""Findings as JSON, HTML and figures."""
