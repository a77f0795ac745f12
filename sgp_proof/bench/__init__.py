"""Speed and memory, compared with other packages and the limits of the machine."""
