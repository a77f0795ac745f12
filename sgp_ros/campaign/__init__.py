"""Many recordings of one kind of robot: their results in one table, trends, changes."""
