"""Reads a train's snapshots from outside, with iceoryx2's own Python binding: outside.py ROOT TRAIN COUNT."""

import ctypes
import sys
import time
from pathlib import Path

import iceoryx2 as iox2

root, train, count = Path(sys.argv[1]), int(sys.argv[2]), int(sys.argv[3])
# What the daemon says of itself: the layouts, and the prefix of its segments.
announcement = dict(
    line.split("=", 1) for line in (root / "trains" / f"{train}.daemon").read_text().split()
)
prefix = announcement["segments"]


class Snapshot(ctypes.Structure):
    """The first fields; dynocar.h has them all."""

    _fields_ = [
        ("epoch", ctypes.c_uint64),
        ("sequence", ctypes.c_uint64),
        ("generation", ctypes.c_uint64),
        ("train_id", ctypes.c_uint64),
        ("rest", ctypes.c_uint64 * (int(announcement["snapshot_bytes"]) // 8 - 4)),
    ]

    @staticmethod
    def type_name() -> str:
        return f"dynocar.ParameterSnapshot.{announcement['snapshot_layout']}"


config = iox2.config.default()
config.global_cfg.prefix = iox2.FileName.new(prefix)
config.global_cfg.root_path = iox2.Path.new(f"/dev/shm/.{prefix.rstrip('_')}")
node = iox2.NodeBuilder.new().config(config).create(iox2.ServiceType.Ipc)
name = iox2.ServiceName.new(f"dynocar/v{announcement['schema']}/train/{train}/snapshots")
# Opened, not made: who makes a service gives it settings that the daemon does not take.
service = node.service_builder(name).publish_subscribe(Snapshot).open()
subscriber = service.subscriber_builder().create()
while count > 0:
    snapshot = subscriber.receive()
    if snapshot is None:
        time.sleep(0.01)
        continue
    payload = snapshot.payload().contents
    print(payload.train_id, payload.epoch, payload.sequence, flush=True)
    # One sample may be borrowed at a time.
    snapshot.delete()
    count -= 1
