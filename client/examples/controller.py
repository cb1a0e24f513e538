"""A controller's cycle: publish a sample, poll, use what the daemon learned, and fall back to the
built-in parameters whenever that is not usable.

    python client/examples/controller.py [train id] [seconds]

reports on standard output whenever its resistance comes from another source. Ten seconds of coasting
teach the daemon next to nothing: let ``dynocar replay config/demo --rate 200`` drive train 1 first,
and this one drives on with what was learned. Python keeps no 1 kHz cycle reliably; it is for tests
and tools, at 100 Hz here.
"""

from __future__ import annotations

import sys
import time

import dynocar

CYCLE_S = 0.01
# The train of config/demo/train.toml, which config/daemon.toml serves as train 1.
MASS_KG = 1_799_200.0
ROTATING_MASS_FACTOR = 0.04
DAVIS = (1.498, 0.0147, 0.00086)  # a, b, c in N/kN and m/s, as the manufacturer declared them


def built_in_force_n(speed_mps: float) -> float:
    a, b, c = DAVIS
    return (a + speed_mps * (b + speed_mps * c)) * MASS_KG * 9.81 / 1000.0


def resistance(reader: dynocar.SnapshotReader, speed_mps: float) -> tuple[float, str]:
    """Resistance in N, and where it comes from and why."""
    snapshot = reader.resistance()
    if snapshot.is_usable:
        estimate = snapshot.resistance_at(speed_mps, MASS_KG)
        if estimate is not None:
            return estimate.force_n, f"the daemon ({snapshot.use_state.name.lower()})"
    return built_in_force_n(speed_mps), f"the built-in parameters ({snapshot.why})"


def main(train_id: int = 1, seconds: int = 10) -> None:
    speed_mps, source_before = 20.0, ""
    cycles = round(seconds / CYCLE_S)
    with dynocar.SamplePublisher(train_id) as publisher, dynocar.SnapshotReader(train_id) as reader:
        deadline_s = time.monotonic()
        for cycle in range(cycles):
            publisher.publish(
                speed_mps=speed_mps,
                traction_force_n=0.0,
                brake_force_n=0.0,
                # This train knows its gradient; one that knows its position sends that instead.
                gradient_permille=0.0,
            )
            reader.poll()
            force_n, source = resistance(reader, speed_mps)
            if source != source_before:
                place = f"{force_n:.0f} N at {speed_mps:.2f} m/s"
                print(f"cycle {cycle}: {place} from {source}", flush=True)
                source_before = source

            # In place of the train: it coasts on the level.
            inertia_kg = MASS_KG * (1.0 + ROTATING_MASS_FACTOR)
            speed_mps -= built_in_force_n(speed_mps) / inertia_kg * CYCLE_S
            deadline_s += CYCLE_S
            time.sleep(max(0.0, deadline_s - time.monotonic()))
    print(f"published {cycles} samples")


if __name__ == "__main__":
    main(*map(int, sys.argv[1:3]))
