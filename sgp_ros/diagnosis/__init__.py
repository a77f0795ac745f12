"""Physics that the nominal robot lacks: compare, locate, explain, decide, prove."""
