"""The package is typed: a type checker follows what users write."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import dynocar
from conftest import PATIENCE_S

RIGHT = """
import dynocar
import numpy as np

with dynocar.SnapshotReader(1) as reader:
    resistance = reader.resistance().resistance_at(20.0, 1e5)
    force_n: float = 0.0 if resistance is None else resistance.force_n
explanation = dynocar.explain("my_train", progress=lambda share, what: print(what))
kinds: list[str] = [effect.kind for effect in explanation.effects]
fastest_mps: float = float(np.max(dynocar.read_dataset("my_train").runs[0].columns["speed_mps"]))
"""

WRONG = """
import dynocar

dynocar.SamplePublisher(1).publish(speed_kmh=20.0)
number: int = dynocar.explain("my_train").verdict
"""


def checked(*arguments: object) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "mypy", "--strict", *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE_S)


def test_the_package_holds_its_own_types() -> None:
    done = checked("--package", "dynocar")
    assert done.returncode == 0, done.stdout


def test_what_users_write_is_followed_and_mistakes_are_found(tmp_path: Path) -> None:
    for name, text in [("right", RIGHT), ("wrong", WRONG)]:
        (tmp_path / f"{name}.py").write_text(text)
    right = checked(tmp_path / "right.py")
    assert right.returncode == 0, right.stdout
    wrong = checked(tmp_path / "wrong.py").stdout
    assert 'Unexpected keyword argument "speed_kmh"' in wrong
    assert 'expression has type "str", variable has type "int"' in wrong


def test_everything_public_is_documented() -> None:
    undocumented = [
        name for name in dynocar.__all__ if name != "__version__" and not getattr(dynocar, name).__doc__
    ]
    assert undocumented == []
