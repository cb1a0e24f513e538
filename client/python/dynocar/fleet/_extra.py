"""The packages that only fleets need."""

from __future__ import annotations

import importlib
from typing import Any

from .._errors import WorkError


def needed(name: str) -> Any:
    """A module of a package of ``dynocar[fleet]``."""
    try:
        return importlib.import_module(name)
    except ImportError as error:
        package = name.partition(".")[0]
        raise WorkError(
            f"fleets need the package {package}: pip install 'dynocar[fleet]'"
        ) from error
