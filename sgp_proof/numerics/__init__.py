"""Numerics beside exact answers: filters, regressors, identifiable parameters."""
