"""Proofs of the product, which never imports them: paper, drawn worlds, real machines, speed."""
