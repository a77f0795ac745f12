"""Gaussian processes: kernels, evidence, the joint posterior of W and Z, streams, scores."""
