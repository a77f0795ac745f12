"""Model files of other programs, read into what a robot YAML states."""
