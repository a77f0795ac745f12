"""Write docs/model_files.md: what the readers of model files say of themselves.

python docs/generate_model_files.py
"""

from __future__ import annotations

from pathlib import Path

from sgp_ros.robots.models import door, mjcf, mjcf_actuators, sdf

TARGET = Path(__file__).parent / 'model_files.md'
_HEAD = """# Model files

`--robot` takes a URDF, a xacro file (`pip install 'sgp_ros[models]'`), MJCF (the same extra: MuJoCo's own
compiler reads it), SDF, or a robot YAML; `--sim` takes a model file too. The format follows from the
ending (`.urdf`, `.xacro`, `.mjcf`, `.sdf`, `.world`), for `.xml` from the root element. Files are named by a path,
or by `package://NAME/PATH`, `model://NAME/PATH` or `file://PATH`; a package is looked for where ROS has it
installed, then beside and above the folder of the file that names it. Meshes of a URDF or SDF are not needed;
MuJoCo wants those of an MJCF where the file says they are.

What a file states becomes a robot YAML: bodies, damping and dry friction stand in its URDF, other physics under
`effects`, gains of drives under `gains`. Nothing is left out silently: everything that cannot be represented is named in
a remark, with its joints or bodies. A xacro file is a program, expanded with its default
arguments by the package `xacro`, as ROS does.

With `--sim FILE` the machine is compared with the model in the file: the bodies are those of the file, and all other effects,
damping and dry friction included, are counted from these bodies on both sides, so that the numbers can be compared.

This page is written by `docs/generate_model_files.py` from
the readers in `sgp_ros/robots/models`.
"""
_FORMATS = (
    ('URDF and xacro', door.READ, door.LEFT, door.REFUSED),
    ('MJCF', mjcf.READ, {**mjcf.LEFT, **mjcf_actuators.LEFT}, mjcf.REFUSED),
    ('SDF', sdf.READ, sdf.LEFT, sdf.REFUSED),
)


def text() -> str:
    """Return the page."""
    parts = [_HEAD]
    for name, read, left, refused in _FORMATS:
        parts += [f'## {name}', '', '| in the file | becomes |', '|---|---|']
        parts += [f'| {what} | {becomes} |' for what, becomes in read]
        parts += ['', 'Remarks on what cannot be represented:', '']
        parts += [f'* {said.rstrip(".")}.' for said in left.values()]
        parts += ['', f'Refused: {"; ".join(refused)}.', '']
    return '\n'.join(parts)


if __name__ == '__main__':
    TARGET.write_text(text(), encoding='utf-8')
