"""The mathematics of semi-parametric Gaussian processes: arrays in, arrays out."""
