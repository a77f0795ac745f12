"""Speed and memory beside rivals and the machine's limit."""
