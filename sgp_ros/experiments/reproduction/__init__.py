"""The experiments of Wu and Movellan, with every method through one interface."""
