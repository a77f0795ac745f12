"""What the commands run: simulation, replay, demonstration."""
