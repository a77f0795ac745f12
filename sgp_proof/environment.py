"""What a benchmark ran on, to stand beside its numbers."""

from sgp_proof.bench.machine import machine as environment

__all__ = ['environment']
