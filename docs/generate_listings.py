"""Write config/listings.json, from which `sgp robots` and `sgp effects` come without computing.

python docs/generate_listings.py
"""

from __future__ import annotations

import json
from pathlib import Path

from sgp_ros.physics.catalogue import EFFECTS, listed
from sgp_ros.robots.registry import load_robot, robot_names

TARGET = Path(__file__).parents[1] / 'config' / 'listings.json'


def text() -> str:
    """Return the file."""
    robots = [(name, load_robot(name)) for name in robot_names()]
    content = {
        'robots': [
            {'name': name, 'description': robot.description, 'joints': list(robot.joint_names)}
            for name, robot in robots
        ],
        'effects': [listed(law) for law in EFFECTS.values()],
    }
    return f'{json.dumps(content, indent=1, ensure_ascii=False, allow_nan=False)}\n'


if __name__ == '__main__':
    TARGET.write_text(text(), encoding='utf-8')
