"""Drives a train through dynocar.py and prints what it sees; the test plays the daemon.

round_trip.c does the same and prints the same lines.
"""

import sys
import time

import dynocar
from dynocar import Manoeuvre, Parameter, PipelineKind, RejectionReason

PATIENCE_CYCLES = 60000


def publish(publisher, cycle):
    publisher.publish(
        time_ns=1000 + cycle,
        direction=-1,
        wheel_slide=True,
        position_m=cycle + 0.5,
        speed_mps=cycle + 1.5,
        traction_force_n=cycle + 2.5,
        brake_force_n=cycle + 3.5,
        brake_cylinder_pressure_pa=cycle + 4.5,
        acceleration_mps2=cycle + 5.5,
        specific_force_mps2=cycle + 6.5,
        mass_kg=cycle + 7.5,
        ambient_temperature_degc=cycle + 8.5,
        gradient_permille=cycle + 9.5,
        curve_radius_m=cycle + 10.5,
    )


def print_snapshot(snapshot):
    print("sample_sequence", snapshot.raw.sample_sequence)
    print("status", snapshot.status.name.lower(), snapshot.reason.name.lower())
    print("pipeline", snapshot.raw.pipeline_index, snapshot.pipeline_kind.name.lower())
    resistance = snapshot.resistance_at(20.0, 1e5)
    print("resistance", *map(repr, resistance[:4]))
    print("extrapolated", int(resistance.is_extrapolated))
    value, std = snapshot.values[Parameter.DAVIS_B], snapshot.std(Parameter.DAVIS_B)
    print("davis_b", repr(value), repr(std))
    covariance = snapshot.covariance(Parameter.DAVIS_B, Parameter.DAVIS_C)
    places = [snapshot.parameters.index(it) for it in (Parameter.DAVIS_C, Parameter.DAVIS_B)]
    assert snapshot.covariance_matrix[places[0]][places[1]] == covariance
    print("covariance", repr(covariance))
    print("wheel_slide", snapshot.rejected[RejectionReason.WHEEL_SLIDE])
    wanted = Manoeuvre.COAST_SLOW | Manoeuvre.ACCELERATE
    print("manoeuvres", int(snapshot.missing_manoeuvres == wanted))


def drive(publisher, reader):
    """Publishes until an answer to the 20th sample or a later one is usable."""
    for cycle in range(PATIENCE_CYCLES):
        now_ns = dynocar.monotonic_now_ns()
        publish(publisher, cycle)
        reader.poll()
        snapshot = reader.resistance(now_ns)
        if snapshot.is_usable and snapshot.raw.sample_sequence >= 20:
            same = reader.latest_by_index(3, now_ns)
            kind = reader.latest(PipelineKind.RESISTANCE_KALMAN, now_ns)
            sequences = {same.raw.sequence, kind.raw.sequence, snapshot.raw.sequence}
            print("same", int(len(sequences) == 1))
            mass = reader.mass(now_ns)
            print("provided", int(reader.braking_ratio(now_ns).is_usable), int(mass.code))
            assert (mass.why, mass.is_usable, mass.is_stale) == ("not_provided", False, True)
            print_snapshot(snapshot)
            return cycle + 1
        time.sleep(0.001)
    sys.exit("no answer")


def wait_for_silence(reader):
    """Polls until the daemon, which stops at a new run, counts as silent."""
    for _ in range(PATIENCE_CYCLES):
        reader.poll()
        snapshot = reader.latest(PipelineKind.RESISTANCE_KALMAN)
        if snapshot.is_stale:
            words = snapshot.status.name.lower(), snapshot.reason.name.lower()
            print("silent", *words, int(snapshot.is_usable))
            return
        time.sleep(0.001)
    sys.exit("never silent")


def second_controller(train, root):
    try:
        dynocar.SamplePublisher(train, root)
    except dynocar.DynocarError as error:
        assert "already has a controller" in str(error), error
        return int(error.code)
    return 0


def main(root, train):
    print("matches 1")  # the import refuses a library of another layout
    print("daemon", int(dynocar.daemon_state(train, root)[0]))
    with dynocar.SamplePublisher(train, root) as publisher:
        with dynocar.SnapshotReader(train, root) as reader:
            reader.set_stale_after_ns(100_000_000)
            print("second", second_controller(train, root))
            cycle = drive(publisher, reader)
            publisher.start_run()
            publish(publisher, cycle)
            wait_for_silence(reader)
            print("refused", reader.refused)
            print("untaken", publisher.flush(60.0))


if __name__ == "__main__":
    main(sys.argv[1], int(sys.argv[2]))
