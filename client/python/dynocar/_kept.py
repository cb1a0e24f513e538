"""What an explanation answers in another process, where its runs are not."""

from __future__ import annotations

import os
import tempfile
from pathlib import Path
from typing import Any

from . import _native
from ._errors import WorkError


class Kept:
    """What is asked of an explanation in another process."""

    def __init__(self, answers: dict[str, Any], grown: dict[str, str] | Exception) -> None:
        self._answers = answers
        self._grown = grown

    @classmethod
    def of(cls, native: _native.Explained | Kept) -> Kept:
        if isinstance(native, Kept):
            return native
        names = ("json", "text", "page", "plots", "predictions")
        answers = {name: getattr(native, name)() for name in names}
        grown: dict[str, str] | Exception
        try:
            with tempfile.TemporaryDirectory() as folder:
                files, answers["not_expressed"] = native.write_grown(folder)
                grown = {Path(file).name: Path(file).read_text() for file in files}
        except Exception as error:
            grown = error
        return cls(answers, grown)

    def json(self) -> str:
        return str(self._answers["json"])

    def text(self) -> str:
        return str(self._answers["text"])

    def page(self) -> str:
        return str(self._answers["page"])

    def plots(self) -> list[tuple[str, str]]:
        return list(self._answers["plots"])

    def predictions(self) -> list[tuple[str, _native.Table]]:
        return list(self._answers["predictions"])

    def write_grown(self, folder: str | os.PathLike[str]) -> tuple[list[Path], list[str]]:
        if isinstance(self._grown, Exception):
            raise self._grown
        place = Path(folder)
        place.mkdir(parents=True, exist_ok=True)
        taken = [place / name for name in self._grown if (place / name).exists()]
        if taken:
            raise WorkError(f"{taken[0]}: exists already")
        for name, text in self._grown.items():
            (place / name).write_text(text)
        return [place / name for name in self._grown], self._answers["not_expressed"]
