"""Effects that can be asserted, with their certainty and equivalents."""
