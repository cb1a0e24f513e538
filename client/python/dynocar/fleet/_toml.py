"""The descriptions that a dataset is made of."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

from .._errors import InputError

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib


def read(file: Path) -> dict[str, Any]:
    """The tables of a file."""
    try:
        return tomllib.loads(file.read_text(encoding="utf-8"))
    except OSError as error:
        raise InputError(f"{file}: cannot be read: {error.strerror}", str(file)) from error
    except ValueError as error:
        raise InputError(f"{file}: not valid TOML: {error}", str(file)) from error


def write(tables: dict[str, Any], file: Path) -> None:
    """Writes tables of numbers, texts, lists and tables."""
    file.write_text(
        "".join(
            f"[{name}]\n{_table(table)}"
            if isinstance(table, dict)
            else "".join(f"[[{name}]]\n{_table(entry)}" for entry in table)
            for name, table in tables.items()
        ),
        encoding="utf-8",
    )


def _table(table: dict[str, Any]) -> str:
    return "".join(f"{json.dumps(key)} = {_value(value)}\n" for key, value in table.items())


def _value(value: Any) -> str:
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{json.dumps(k)} = {_value(v)}" for k, v in value.items()) + " }"
    if isinstance(value, list):
        return "[" + ", ".join(map(_value, value)) + "]"
    if isinstance(value, float):
        return repr(value)
    # A text, a truth value or a whole number, written as in JSON.
    return json.dumps(value, ensure_ascii=False)
