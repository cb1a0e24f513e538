"""Results as objects: each key of the command's JSON is an attribute."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, ClassVar


class Record:
    """A part of a result, read-only.

    ``record.speed_mps`` and ``record["speed_mps"]`` are the same; the latter takes keys that are no
    names in Python, such as files. ``to_dict`` gives plain dictionaries and lists.
    """

    # What the parts under some keys are made of.
    _kinds: ClassVar[dict[str, type[Record]]] = {}
    # Keys that the JSON leaves out where there is nothing to say: ``None`` then.
    _optional: ClassVar[tuple[str, ...]] = ()
    _fields: dict[str, Any]

    def __init__(self, fields: dict[str, Any]) -> None:
        made = {key: _made(self._kinds.get(key, Record), value) for key, value in fields.items()}
        self.__dict__["_fields"] = made

    def __reduce__(self) -> tuple[Any, ...]:
        return (_restored, (type(self), self.__dict__))

    def __getattr__(self, name: str) -> Any:
        fields = self.__dict__.get("_fields", {})
        if name in fields:
            return fields[name]
        if name in type(self)._optional:
            return None
        known = ", ".join(fields)
        raise AttributeError(f"{type(self).__name__} has no {name!r}; it has {known}")

    def __setattr__(self, name: str, value: Any) -> None:
        raise AttributeError("a result cannot be changed")

    def __getitem__(self, key: str) -> Any:
        return self._fields[key]

    def __contains__(self, key: object) -> bool:
        return key in self._fields

    def __iter__(self) -> Iterator[str]:
        return iter(self._fields)

    def __len__(self) -> int:
        return len(self._fields)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Record) and self._fields == other._fields

    __hash__ = None  # type: ignore[assignment]

    def __dir__(self) -> list[str]:
        return [*super().__dir__(), *self._fields]

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self._fields!r})"

    def to_dict(self) -> dict[str, Any]:
        """Plain dictionaries, lists, numbers and texts."""
        return {key: _plain(value) for key, value in self._fields.items()}


def _restored(kind: type[Record], state: dict[str, Any]) -> Record:
    record = kind.__new__(kind)
    record.__dict__.update(state)
    return record


def _made(kind: type[Record], value: Any) -> Any:
    if isinstance(value, dict):
        return kind(value)
    if isinstance(value, list):
        return [_made(kind, item) for item in value]
    return value


def _plain(value: Any) -> Any:
    if isinstance(value, Record):
        return value.to_dict()
    if isinstance(value, list):
        return [_plain(item) for item in value]
    return value
