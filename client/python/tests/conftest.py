"""What the tests share: the programs just built, a daemon that is played, recorded runs."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).resolve().parents[3]
# Where cargo put the programs.
PROGRAMS = Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target")) / "release"
# Whatever takes longer than this has failed.
PATIENCE_S = 300

# A shell starts what runs in its background with Ctrl-C ignored, and the tests send one.
signal.signal(signal.SIGINT, signal.default_int_handler)
TRAIN = 11


def wait_for(condition: Callable[[], object]) -> None:
    """Waits until something is true."""
    deadline_s = time.monotonic() + PATIENCE_S
    while not condition():
        assert time.monotonic() < deadline_s, "it never came true"
        time.sleep(0.002)


def dynocar_command(*arguments: object, **more: Any) -> subprocess.CompletedProcess[str]:
    """The command line with these arguments, run to its end."""
    command = [PROGRAMS / "dynocar", *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE_S, **more)


class Lines:
    """A program whose lines are read as they come."""

    def __init__(self, *command: object, **more: Any) -> None:
        self.lines: list[str] = []
        self.process = subprocess.Popen(
            list(map(str, command)), stdout=subprocess.PIPE, text=True, **more
        )
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def _read(self) -> None:
        assert self.process.stdout is not None
        self.lines.extend(line.rstrip("\n") for line in self.process.stdout)

    def wait_for_line(self, words: str) -> None:
        """Waits until a line holds the words."""
        wait_for(lambda: any(words in line for line in self.lines) or self._has_ended())
        assert any(words in line for line in self.lines), self.lines

    def _has_ended(self) -> bool:
        return self.process.poll() is not None and not self._reader.is_alive()

    def end(self) -> None:
        if self.process.stdin is not None:
            self.process.stdin.close()
        else:
            self.process.kill()
        self.process.wait(PATIENCE_S)


class PlayedDaemon(Lines):
    """A daemon with one pipeline for train 11; its answers are those of `client/tests/support`."""

    def __init__(self) -> None:
        super().__init__(PROGRAMS / "dynocar-played-daemon", stdin=subprocess.PIPE)
        self.wait_for_line("root")
        self.root: str = json.loads(self.lines[0])["root"]

    @property
    def samples(self) -> list[dict[str, Any]]:
        """Every sample that it has taken."""
        return [json.loads(line) for line in self.lines[1:]]

    def order(self, words: str) -> None:
        """`answer` or `silence`."""
        assert self.process.stdin is not None
        print(words, file=self.process.stdin, flush=True)


@pytest.fixture
def played() -> Iterator[PlayedDaemon]:
    daemon = PlayedDaemon()
    yield daemon
    daemon.end()


@pytest.fixture(scope="session")
def recordings(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The demo's dataset, some minutes of each run, the last one held out."""
    folder = tmp_path_factory.mktemp("recordings") / "short"
    shutil.copytree(ROOT / "config/demo", folder)
    for run in (folder / "runs").iterdir():
        run.write_text("".join(run.read_text().splitlines(keepends=True)[:2001]))
    manifest = (folder / "dataset.toml").read_text()
    head, last = manifest.rsplit('role = "fit"', 1)
    (folder / "dataset.toml").write_text(f'{head}role = "holdout"{last}')
    return folder
