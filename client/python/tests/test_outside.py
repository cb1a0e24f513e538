"""Programs that use the channels without the client library, by iceoryx2's own binding from PyPI."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
from conftest import PROGRAMS, Lines, wait_for

OUTSIDE = Path(__file__).with_name("outside.py")
STRANGER = """
import ctypes, sys, time
import iceoryx2 as iox2

class Sample(ctypes.Structure):
    _fields_ = [("all", ctypes.c_uint64 * 16)]

    @staticmethod
    def type_name():
        return "dynocar.TrainSample." + sys.argv[2]

config = iox2.config.default()
config.global_cfg.prefix = iox2.FileName.new(sys.argv[1])
config.global_cfg.root_path = iox2.Path.new("/dev/shm/." + sys.argv[1].rstrip("_"))
node = iox2.NodeBuilder.new().config(config).create(iox2.ServiceType.Ipc)
name = iox2.ServiceName.new("dynocar/v1/train/1/samples")
service = node.service_builder(name).publish_subscribe(Sample).open_or_create()
print("made", flush=True)
time.sleep(300)
"""
TRAIN = """[train]
name = "test train"
mass_t = 200.0
length_m = 120.0
cars = 6
rotating_mass_factor = 0.08

[resistance]
a = 1.9
b = 0.03
c = 0.0043
"""


class Daemon:
    """A daemon under a root of its own."""

    def __init__(self, folder: Path) -> None:
        (folder / "train.toml").write_text(TRAIN)
        trains = '[daemon]\n[[trains]]\nid = 1\nfile = "train.toml"\n'
        (folder / "daemon.toml").write_text(trains + '[[pipelines]]\nkind = "echo"\n')
        self.log = folder / "log"
        with self.log.open("w") as log:
            command = [PROGRAMS / "dynocar", "run", "--config", folder / "daemon.toml"]
            environment = os.environ | {"DYNOCAR_ROOT": str(folder / "root")}
            self.process = subprocess.Popen(command, stderr=log, env=environment)
        wait_for(lambda: "serving" in self.words() or self.process.poll() is not None)

    def words(self) -> str:
        """Its log."""
        return self.log.read_text()

    def end(self) -> int:
        """Its exit status, asked to end."""
        self.process.terminate()
        return self.process.wait()


def announced(folder: Path) -> dict[str, str]:
    """What the newest daemon said of itself."""
    text = (folder / "root/trains/1.daemon").read_text()
    return dict(line.split("=", 1) for line in text.split())


def test_iceoryx2_of_pypi_reads_what_the_daemon_says(tmp_path: Path) -> None:
    pytest.importorskip("iceoryx2")
    daemon = Daemon(tmp_path)
    command = [sys.executable, OUTSIDE, tmp_path / "root", "1", "20"]
    read = subprocess.run(list(map(str, command)), capture_output=True, text=True, timeout=60)
    assert daemon.end() == 0
    lines = [line.split() for line in read.stdout.splitlines()]
    assert len(lines) == 20, read.stderr
    assert {(line[0], line[1]) for line in lines} == {("1", lines[0][1])}
    assert f"epoch={lines[0][1]}" in daemon.words()


def test_a_stranger_that_made_a_channel_first_is_named(tmp_path: Path) -> None:
    pytest.importorskip("iceoryx2")
    assert Daemon(tmp_path).end() == 0
    said = announced(tmp_path)
    arguments = [said["segments"], said["sample_layout"]]
    stranger = Lines(sys.executable, "-c", STRANGER, *arguments)
    stranger.wait_for_line("made")
    kept_out = Daemon(tmp_path)
    assert kept_out.process.wait() == 1
    words = kept_out.words()
    assert f"(process {stranger.process.pid})" in words, words
    assert "dynocar/v1/train/1/samples: made with other settings by a program" in words
    stranger.process.kill()
    stranger.process.wait()
    assert Daemon(tmp_path).end() == 0
