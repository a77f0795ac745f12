"""Speed and memory beside rivals and the limits of the machine."""
