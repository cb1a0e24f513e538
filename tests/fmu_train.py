"""FMPy validates the train as an FMU and drives a holdout run; `dynocar explain` predicts it."""

import sys
from pathlib import Path

import numpy
from fmpy import extract, read_model_description, simulate_fmu
from fmpy.fmi2 import FMU2Slave
from fmpy.util import read_csv
from fmpy.validation import validate_fmu

# Predictions are written with four digits.
TOLERANCE_MPS = 6e-5

place = Path(sys.argv[1])
fmu = str(place / "train.fmu")
problems = validate_fmu(fmu)
assert not problems, problems

# The holdout run is the fourth.
signals = read_csv(place / "inputs" / "run_04.csv")
times = signals["time"]
predicted = numpy.genfromtxt(place / "predicted" / "06.csv", delimiter=",", names=True)
predicted_times, predicted_mps = (predicted[name] for name in predicted.dtype.names)
assert len(predicted) == len(signals), (len(predicted), len(signals))
assert numpy.abs(predicted_times - times).max() < 1e-3


description = read_model_description(fmu)
references = {it.name: it.valueReference for it in description.modelVariables}
kinds = {it.name: (it.causality, it.type) for it in description.modelVariables}
inputs = [name for name, kind in kinds.items() if kind == ("input", "Real")]
outputs = [name for name, kind in kinds.items() if kind == ("output", "Real")]


def drive_by_slopes():
    """The run with each input's slope towards the next sample; what is missing has none."""
    values = numpy.stack([signals[name] for name in inputs], axis=1)
    slopes = numpy.diff(values, axis=0) / numpy.diff(times)[:, None]
    train = FMU2Slave(
        guid=description.guid,
        unzipDirectory=extract(fmu, place / "unpacked"),
        modelIdentifier=description.coSimulation.modelIdentifier,
        instanceName="train",
    )
    train.instantiate()
    train.setupExperiment(startTime=times[0])
    train.setReal([references["initial_speed_mps"]], [predicted_mps[0]])
    train.enterInitializationMode()
    train.setReal([references[name] for name in inputs], values[0])
    train.setInteger([references["direction"]], [int(signals["direction"][0])])
    train.exitInitializationMode()
    numbers = [references[name] for name in outputs]
    rows = [train.getReal(numbers)]
    for k, slope in enumerate(slopes):
        train.setReal([references[name] for name in inputs], values[k])
        train.setRealInputDerivatives([references[name] for name in inputs], [1] * len(inputs), slope)
        train.doStep(times[k], times[k + 1] - times[k])
        rows.append(train.getReal(numbers))
    train.terminate()
    train.freeInstance()
    return dict(zip(outputs, numpy.array(rows).T, strict=True))


results = drive_by_slopes()
speed_mps = results["motion.speed_mps"]
missed_mps = numpy.abs(speed_mps - predicted_mps).max()
assert missed_mps < TOLERANCE_MPS, f"{missed_mps} m/s from what explain predicts"
rmse_mps = numpy.sqrt(numpy.mean((speed_mps - signals["speed_mps"]) ** 2))

# Forces that stay until the next step come half a step late, and no more.
held = simulate_fmu(
    fmu,
    start_time=times[0],
    stop_time=times[-1],
    output_interval=times[1] - times[0],
    input=signals,
    start_values={"initial_speed_mps": predicted_mps[0]},
)
assert len(held) == len(signals), (len(held), len(signals))
held_missed_mps = numpy.abs(held["motion.speed_mps"] - predicted_mps).max()
assert missed_mps < held_missed_mps < 0.2, held_missed_mps

parts = [name for name in results if name.startswith("force.")]
parts = [name for name in parts if name not in ("force.traction_n", "force.resistance_n")]
retarding_n = sum(results[name] for name in parts)
force_n = results["force.traction_n"] - retarding_n
inertial_n = 1.04 * results["motion.mass_kg"] * results["motion.acceleration_mps2"]
assert numpy.allclose(force_n[speed_mps > 0], inertial_n[speed_mps > 0], atol=1e-3)
gain = signals["traction_force_n"][1:] / numpy.maximum(results["force.traction_n"][1:], 1)
assert abs(numpy.median(gain[gain > 1]) - 1.2) < 0.02, "the gain that was found acts"

print(f"FMPy: the train is valid; {len(speed_mps)} samples within {missed_mps:.1e} m/s of explain's")
print(f"({held_missed_mps:.3f} m/s where forces stay for a step), {rmse_mps:.3f} m/s from the measured")
