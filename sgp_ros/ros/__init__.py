"""Nodes: messages in, messages out, no computation of their own."""
