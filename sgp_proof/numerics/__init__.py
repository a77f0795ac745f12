"""Numerics compared with exact answers: filters, regressors, identifiable parameters."""
