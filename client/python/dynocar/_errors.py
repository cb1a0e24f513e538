"""What Dynocar raises, by the stage that failed; the words are those of the command line."""

from __future__ import annotations

from ._vocabulary import Code


class DynocarError(Exception):
    """Whatever Dynocar refuses or cannot do."""


class ChannelError(DynocarError):
    """A channel that cannot be opened or used; ``code`` says why, the text says it in words."""

    def __init__(self, words: str, code: int) -> None:
        super().__init__(words)
        self.code = Code(code)

    def __reduce__(self) -> tuple[type[ChannelError], tuple[str, int]]:
        return type(self), (str(self), int(self.code))


class InputError(DynocarError):
    """A wrong file or argument (exit status 2 of the command line).

    ``file`` is the file that is wrong and ``line`` its line, from 1; ``None`` where there is none.
    """

    def __init__(self, words: str, file: str | None = None, line: int | None = None) -> None:
        super().__init__(words)
        self.file = file
        self.line = line


class WorkError(DynocarError):
    """Work that failed, or a result that cannot be written (exit status 1 of the command line)."""
