"""Real machines, with what is known of them."""
