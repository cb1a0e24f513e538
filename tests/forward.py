"""A hundred trains, a broker that is absent, killed, stopped and back; run by forward.sh.

usage: forward.py PLACE PROGRAMS
"""

import os
import re
import signal
import socket
import subprocess
import sys
import threading
import time
from pathlib import Path

from paho.mqtt import publish
from paho.mqtt.client import MQTTv5
from pysparkplug import DBirth, DData, NBirth, NData, NDeath
from pysparkplug._protobuf import Payload

TRAINS = 100
KINDS = ["trajectory_kalman", "mass_kalman", "residual_monitor"]
QUEUE = 1000
# What waits takes about 2 kB a publication, and a train's readers and metrics about 200 kB.
MEMORY_MAX_KIB = 96 * 1024
PATIENCE_S = 240

place, programs = Path(sys.argv[1]), Path(sys.argv[2])
project = Path(__file__).resolve().parent.parent
environment = dict(os.environ, DYNOCAR_ROOT=str(place / "root"), STATE_DIRECTORY=str(place / "state"))
processes = []
begun = time.monotonic()


def start(name, *command):
    with open(place / name, "ab") as log:
        process = subprocess.Popen(command, env=environment, stdout=log, stderr=log)
    processes.append(process)
    return process


def said(name):
    return (place / name).read_text(errors="replace")


def wait(condition, what):
    end = time.monotonic() + PATIENCE_S
    while not condition():
        for process in processes:
            if process.poll() not in (None, -signal.SIGKILL):
                sys.exit(f"{process.args} has ended with {process.returncode}, waiting for {what}: {said('forward')}")
        if host.wrong:
            sys.exit(f"{host.wrong[:10]}, waiting for {what}")
        if time.monotonic() > end:
            sys.exit(f"waited in vain for {what}\n{said('forward')}\n{host.summary()}")
        time.sleep(0.1)
    print(f"{time.monotonic() - begun:6.1f} s: {what}", flush=True)


def reported_drops():
    return max(map(int, re.findall(r"(\d+) publications dropped so far", said("forward"))), default=0)


def memory_kib(process):
    status = Path(f"/proc/{process.pid}/status").read_text()
    return int(re.search(r"VmHWM:\s+(\d+)", status)[1])


class Host:
    """A host application: it decodes what comes and holds it against Sparkplug's rules."""

    def __init__(self):
        self.lock = threading.Lock()
        self.client = self.reader = None
        self.clients = 0
        self.wrong = []
        self.publications = {}  # by device: the numbers that came, as a set
        self.repeated = 0
        self.historical = 0
        self.births = []  # bdSeq of each NBIRTH
        self.deaths = []  # bdSeq of each NDEATH
        self.devices = {}  # births of this session
        self.ever = {}
        self.dead = set()
        self.seq = None
        self.node = None
        self.events = []
        self.units = {}
        self.counts = {}
        self.messages = 0

    def summary(self):
        with self.lock:
            return (f"{self.messages} messages, births {self.births}, {len(self.devices)} devices, "
                    f"{len(self.dead)} dead, {self.taken()} publications, wrong {self.wrong[:5]}")

    def taken(self):
        return sum(len(numbers) for numbers in self.publications.values())

    def attach(self):
        """A new client, for the broker that the last one knew may be dead. It writes down what comes as fast as
        it comes; it is read at leisure, so that no broker drops anything for a busy reader."""
        if self.client:
            self.client.kill()
            self.client.wait()
            processes.remove(self.client)
        self.clients += 1
        name, mark = f"came-{self.clients}", f"spBv1.0/attached/{self.clients}"
        self.client = start(name, "mosquitto_sub", "-V", "5", "-h", "127.0.0.1", "-p", str(port), "-t", "spBv1.0/#",
                            "-F", "%t %x")
        end = time.monotonic() + PATIENCE_S
        while mark not in said(name):
            if time.monotonic() > end:
                sys.exit("the broker takes no subscription")
            publish_to(mark, b"")
            time.sleep(0.1)
        if self.reader is None:
            self.reader = threading.Thread(target=self.read, daemon=True)
            self.reader.start()

    def read(self):
        number, rest = 1, b""
        log = open(place / "came-1", "rb")
        while True:
            # Whether there is a next client is asked first: then what this one wrote is whole.
            is_last = number == self.clients
            *lines, rest = (rest + log.read()).split(b"\n")
            for line in lines:
                with self.lock:
                    self.take_line(line.decode())
            if not lines and is_last:
                time.sleep(0.02)
            elif not lines:
                number, rest = number + 1, b""
                log = open(place / f"came-{number}", "rb")
                with self.lock:
                    self.seq = None

    def take_line(self, line):
        topic, _, payload = line.partition(" ")
        try:
            self.take(topic.split("/"), bytes.fromhex(payload))
        except Exception as error:  # noqa: BLE001: whatever it is, the test fails with it
            self.wrong.append(f"{topic}: {error!r}")

    def require(self, condition, words):
        if not condition:
            self.wrong.append(words)

    def take(self, topic, raw):
        if topic[1] == "attached":
            return
        self.messages += 1
        kind, device = topic[2], topic[4] if len(topic) > 4 else None
        if kind == "NCMD":
            return
        self.require(topic[:2] + [topic[3]] == ["spBv1.0", "depot", "edge"], f"topic {topic}")
        plain = Payload.FromString(raw)
        if kind == "NDEATH":
            death = NDeath.decode(raw).bd_seq_metric
            self.require(death.name == "bdSeq", f"a death with {death}")
            self.deaths.append(death.value)
            self.require(not plain.HasField("seq"), "a death has no number")
            return
        if kind == "NBIRTH":
            self.node = NBirth.decode(raw)
            self.births.append({it.name: it.value for it in self.node.metrics}["bdSeq"])
            self.require(plain.seq == 0, f"a birth with number {plain.seq}")
            self.devices, self.seq = {}, 0
        else:
            if self.seq is None:
                self.require(False, f"{kind} before any birth")
            else:
                self.require(plain.seq == (self.seq + 1) % 256, f"{kind} {plain.seq} after {self.seq}")
            self.seq = plain.seq
        if kind in ("NBIRTH", "NDATA"):
            payload = self.node if kind == "NBIRTH" else NData.decode(raw, birth=self.node)
            self.counts.update({it.name: it.value for it in payload.metrics})
        elif kind == "DBIRTH":
            self.devices[device] = self.ever[device] = DBirth.decode(raw)
            self.dead.discard(device)
            for metric in plain.metrics:
                for key, value in zip(metric.properties.keys, metric.properties.values):
                    self.units[metric.name] = (key, value.string_value)
        elif kind == "DDEATH":
            self.devices.pop(device)
            self.dead.add(device)
        elif kind == "DDATA":
            self.take_data(device, raw)
        else:
            self.require(False, f"kind {kind}")

    def take_data(self, device, raw):
        if device not in self.devices:
            self.require(False, f"data of {device} before its birth")
            return
        data = DData.decode(raw, birth=self.devices[device])
        values = {it.name: it.value for it in data.metrics}
        self.require(all(it.timestamp for it in data.metrics), "a metric without a time")
        self.historical += any(it.is_historical for it in data.metrics)
        numbers = self.publications.setdefault(device, set())
        self.repeated += values["publication"] in numbers
        numbers.add(values["publication"])
        if "event/kind" in values and not data.metrics[0].is_null:
            self.events.append(values["event/kind"])


def publish_to(topic, payload):
    publish.single(topic, payload, qos=1, hostname="127.0.0.1", port=port, protocol=MQTTv5)


def free_port():
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


def start_broker():
    broker = start("broker", "mosquitto", "-c", str(place / "mosquitto.conf"))

    def is_there():
        with socket.socket() as probe:
            return probe.connect_ex(("127.0.0.1", port)) == 0

    wait(is_there, "the broker")
    return broker


def while_held(process, act):
    """A process is stopped while something is brought about, so that it misses nothing of it."""
    process.send_signal(signal.SIGSTOP)
    try:
        return act()
    finally:
        process.send_signal(signal.SIGCONT)


def broker_with_host():
    broker = start_broker()
    host.attach()
    return broker


host = Host()
port = free_port()
# The configuration that the project ships, on a port of its own.
shipped = (project / "config/forward/mosquitto.conf").read_text()
own = shipped.replace("listener 1883 127.0.0.1", f"listener {port} 127.0.0.1")
own = own.replace("/var/lib/mosquitto/", f"{place}/persistence/")
assert own.count(str(port)) == 1 and own.count(str(place)) == 1, own
(place / "persistence").mkdir(mode=0o777)
os.chmod(place, 0o755)
os.chmod(place / "persistence", 0o777)
(place / "mosquitto.conf").write_text(own)

train = "[train]\nname = \"test\"\nmass_t = 200.0\nlength_m = 120.0\ncars = 6\nrotating_mass_factor = 0.08\n"
(place / "train.toml").write_text(train + "[resistance]\na = 1.9\nb = 0.03\nc = 0.0043\n")
config = "[daemon]\nlog = \"error\"\nidle = \"event\"\n"
config += "".join(f"[[trains]]\nid = {id}\nfile = \"train.toml\"\n" for id in range(1, TRAINS + 1))
config += "[[threads]]\nname = \"all\"\n"
config += "".join(f"[[pipelines]]\nkind = \"{kind}\"\nthread = \"all\"\n" for kind in KINDS)
(place / "daemon.toml").write_text(config)

try:
    # 1. A broker that is not there yet: the queue fills, the oldest go, memory stays.
    daemon = start("daemon", programs / "dynocar", "run", "--config", str(place / "daemon.toml"))
    controllers = start("controllers", programs / "dynocar-test-peer", "controllers", str(TRAINS), "200000")
    wait(lambda: f"{TRAINS} controllers" in said("controllers"), "the controllers")
    forward = start("forward", programs / "dynocar", "forward", "--broker", f"127.0.0.1:{port}", "--group", "depot",
                    "--node", "edge", "--every-ms", "500", "--queue", str(QUEUE))
    wait(lambda: "cannot be reached" in said("forward"), "the word that there is no broker")
    wait(lambda: reported_drops() > 0, "drops to be reported")
    full_kib = memory_kib(forward)

    # 2. The broker comes: births of all, then what waited, marked as of the past, then what is new.
    broker = while_held(forward, broker_with_host)
    wait(lambda: len(host.devices) == TRAINS, "the births of all trains")
    wait(lambda: host.historical >= QUEUE // 2, "what waited")
    wait(lambda: host.counts.get("forward/dropped", 0) > 0, "the count of drops")
    before = host.taken()
    wait(lambda: host.taken() >= before + 3 * TRAINS, "new data")
    first_births = list(host.births)

    # 3. The broker is killed while it is at work, and comes back.
    broker.kill()
    broker.wait()
    wait(lambda: said("forward").count("trying again") >= 2, "the loss of the broker to be reported")
    broker = while_held(forward, broker_with_host)
    wait(lambda: len(host.births) > len(first_births), "a new birth of the node")
    wait(lambda: len(host.devices) == TRAINS, "new births of all trains")
    before = host.taken()
    wait(lambda: host.taken() >= before + 3 * TRAINS, "new data")

    # 4. A broker that takes nothing for so long that the queue is full again, and goes on.
    dropped = host.counts["forward/dropped"]
    broker.send_signal(signal.SIGSTOP)
    wait(lambda: reported_drops() > dropped, "drops by a slow broker")
    broker.send_signal(signal.SIGCONT)
    wait(lambda: host.counts["forward/dropped"] > dropped, "the count of them")
    wait(lambda: len(host.devices) == TRAINS, "all trains")
    before = host.taken()
    wait(lambda: host.taken() >= before + 3 * TRAINS, "new data")

    # 5. A host that asks for all births anew.
    births = len(host.births)
    command = Payload()
    command.timestamp = int(1000 * time.time())
    metric = command.metrics.add(name="Node Control/Rebirth", datatype=11)
    metric.boolean_value = True
    publish_to("spBv1.0/depot/NCMD/edge", command.SerializeToString())
    wait(lambda: len(host.births) > births, "the births that were asked for")
    wait(lambda: len(host.devices) == TRAINS, "the births of all trains")
    assert host.births[-1] == host.births[births - 1], "the connection is the same"

    # 6. The daemon is killed: silence is an event, the devices die, and live again with the next daemon.
    daemon.kill()
    daemon.wait()
    wait(lambda: len(host.dead) == TRAINS, "the deaths of all trains")
    assert host.events.count("daemon_silent") >= TRAINS or host.events.count("daemon_gone") >= TRAINS, host.events
    daemon = start("daemon", programs / "dynocar", "run", "--config", str(place / "daemon.toml"))
    wait(lambda: len(host.devices) == TRAINS, "all trains alive again")

    # 7. The end: what waits is sent, the node dies by its own hand, and the accounts are right.
    kib = memory_kib(forward)
    deaths = len(host.deaths)
    forward.send_signal(signal.SIGTERM)
    assert forward.wait(PATIENCE_S) == 0, said("forward")
    processes.remove(forward)
    wait(lambda: len(host.deaths) > deaths, "the death of the node")
    assert host.deaths[-1] == host.births[-1], (host.deaths, host.births)
    words = r"(\d+) publications made: (\d+) taken by the broker, (\d+) dropped, (\d+) not sent"
    made, taken, dropped, unsent = map(int, re.search(words, said("forward")).groups())
    came = host.taken()
    highest = sum(max(numbers) for numbers in host.publications.values())
    print(f"{TRAINS} trains, {KINDS}: {made} publications made, {taken} taken by the broker, {dropped} dropped, "
          f"{unsent} not sent; {came} came to the host, {host.repeated} of them twice, {host.historical} historical; "
          f"{len(host.births)} births, bdSeq {host.births}, memory {full_kib} KiB with the queue full first, "
          f"{kib} KiB at most")
    assert not host.wrong, host.wrong[:20]
    assert made == taken + dropped + unsent, "every publication is accounted for"
    assert len(host.publications) == TRAINS and unsent == 0
    # What a broker has taken and not passed on is lost when it is killed; what it has passed on without having
    # said so may be dropped later. At most a batch for each connection.
    assert abs(came - taken) <= 256 * len(host.births), (came, taken)
    assert highest == made, "the numbers of publications count every one, dropped or not"
    assert dropped > 0
    assert kib <= MEMORY_MAX_KIB and kib <= full_kib + 24 * 1024, (full_kib, kib)
    unit = host.units["0_trajectory_kalman/resistance_a_n_per_kn"]
    assert unit == ("engUnit", "N/kN"), unit
    names = {it.name: it for it in host.ever["train-1"].metrics}
    for name in ["0_trajectory_kalman/status", "1_mass_kalman/std/mass_t", "2_residual_monitor/suspect",
                 "answers/resistance", "event/text"]:
        assert name in names, sorted(names)
    assert controllers.poll() is None and daemon.poll() is None, "nobody else was disturbed"
    print("every message decoded, every number in its order, every publication accounted for")
finally:
    for process in processes:
        if process.poll() is None:
            process.send_signal(signal.SIGCONT)
            process.kill()
            process.wait()
    # Whoever is killed leaves shared memory behind; its name has a hash (FNV-1a) of the run-time directory.
    mark = 0xCBF29CE484222325
    for byte in os.fsencode(environment["DYNOCAR_ROOT"]):
        mark = (mark ^ byte) * 0x100000001B3 % 2**64
    for segment in Path("/dev/shm").glob(f"dynocar_*_{(mark ^ mark >> 32) % 2**32:08x}_*"):
        segment.unlink(missing_ok=True)
