"""What an explanation answers in another process, where its runs are not."""

from __future__ import annotations

import os
import re
import tempfile
from pathlib import Path
from typing import Any

from . import _native
from ._errors import WorkError

# A file that lies outside, in a text of an updated model: as seen from the model's folder.
_OUTSIDE = re.compile(r"""(?<=["'])\.\./[^"'\n]*""")


class Kept:
    """What is asked of an explanation in another process."""

    def __init__(
        self, answers: dict[str, Any], grown: dict[str, str] | Exception, grown_in: str
    ) -> None:
        self._answers = answers
        self._grown = grown
        # The folder from which the texts see the runs.
        self._grown_in = grown_in

    @classmethod
    def of(cls, native: _native.Explained | Kept) -> Kept:
        if isinstance(native, Kept):
            return native
        names = ("json", "text", "page", "plots", "predictions")
        answers = {name: getattr(native, name)() for name in names}
        grown: dict[str, str] | Exception
        place = Path()
        try:
            with tempfile.TemporaryDirectory() as folder:
                place = Path(folder).resolve()
                files, answers["not_expressed"] = native.write_grown(place)
                answers["files"] = [str(Path(file).relative_to(place)) for file in files]
                # A recording's runs lie beside the model.
                written = (file for file in place.rglob("*") if file.is_file())
                grown = {str(file.relative_to(place)): file.read_text() for file in written}
        except Exception as error:
            grown = error
        return cls(answers, grown, str(place))

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
        place = Path(folder).resolve()
        taken = [place / name for name in self._grown if (place / name).exists()]
        if taken:
            raise WorkError(f"{taken[0]}: exists already")
        for name, text in self._grown.items():
            (place / name).parent.mkdir(parents=True, exist_ok=True)
            # Runs hold measurements, the others name files.
            is_model = name in self._answers["files"]
            (place / name).write_text(self._seen_from(place, text) if is_model else text)
        files = [Path(folder) / name for name in self._answers["files"]]
        return files, self._answers["not_expressed"]

    def _seen_from(self, folder: Path, text: str) -> str:
        def moved(found: re.Match[str]) -> str:
            file = os.path.normpath(os.path.join(self._grown_in, found[0]))
            return os.path.relpath(file, folder)

        return _OUTSIDE.sub(moved, text)
