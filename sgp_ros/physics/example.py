"""The effect of examples, without loading its law: help must come at once."""

from __future__ import annotations


def example_effect(joint: str, level: float) -> str:
    """Return dry friction as a command line states it.

    Args:
        joint: its name.
        level: of the friction [N m or N].
    """
    return f'coulomb_friction:joint={joint},level={level:g}'
