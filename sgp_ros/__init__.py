"""Online identification of robots with semi-parametric Gaussian processes."""

__version__ = '0.1.0'
