"""Physics as data: robots are tuples of named terms, linear in their coefficients."""
