"""FMPy validates the FMU and simulates a recorded run; `dynocar identify` says what it must learn."""

import json
import math
import sys
from pathlib import Path

from fmpy import read_model_description, simulate_fmu
from fmpy.util import read_csv
from fmpy.validation import validate_fmu

ESTIMATORS = {
    "resistance": "train_kalman",
    "mass": "train_kalman",
    "adhesion": "adhesion_law",
    "brake_friction": "brake_smoother",
    "monitor": "residual_monitor",
}

place = Path(sys.argv[1])
fmu = str(place / "dynocar.fmu")
problems = validate_fmu(fmu)
assert not problems, problems

signals = read_csv(place / "inputs" / "run_01.csv")
times = signals["time"]
period = times[1] - times[0]
results = simulate_fmu(
    fmu,
    start_time=times[0],
    # A step takes the sample of its beginning: the last sample needs a step of its own.
    stop_time=times[-1] + period,
    output_interval=period,
    input=signals,
)
assert len(results) == len(signals) + 1, (len(results), len(signals))
last = {name: results[name][-1] for name in results.dtype.names}

members = {
    kind.name: {int(item.value): item.name for item in kind.items}
    for kind in read_model_description(fmu).typeDefinitions
}
identified = json.loads((place / "identified.json").read_text())["runs"][0]["estimators"]
identified = {answer["name"]: answer for answer in identified}


def same(name, found, expected):
    """Equal to the bit; what one side does not know, the other does not know either."""
    expected = math.nan if expected is None else expected
    is_same = found == expected or (math.isnan(found) and math.isnan(expected))
    assert is_same, f"{name}: {found!r} instead of {expected!r}"


def arrived(group):
    """The outputs as the train came to its last stop, where another load may board: `identify` says these."""
    if f"{group}.reason" not in last:
        return last
    names = members["Reason"]
    reasons = [names[int(number)] for number in results[f"{group}.reason"]]
    row = max(row for row, reason in enumerate(reasons) if reason != "load_may_have_changed")
    return {name: results[name][row] for name in results.dtype.names}


compared = 0
for group, estimator in ESTIMATORS.items():
    answer, outputs = identified[estimator], arrived(group)
    names = [name.split(".")[1] for name in last if name.startswith(group + ".")]
    for name in names:
        full, found = f"{group}.{name}", outputs[f"{group}.{name}"]
        if name == "status" or name == "reason":
            assert members[name.capitalize()][int(found)] == answer[name], full
        elif name.endswith("_number"):
            assert int(found) == int(outputs[full.removesuffix("_number")]), full
        elif name == "usable":
            assert found in (0, 1), full  # `identify` does not print it
        elif name == "rejected":
            assert last[full] == sum(answer["samples"]["rejected"].values()), full
        elif name == "unexplained_force_n":
            same(full, found, answer["unexplained_force_n"])
        elif name == "unexplained_force_n_std":
            same(full, found, answer["unexplained_force_std_n"])
        elif name.startswith("w0") or name == "suspected_effect":
            continue  # `identify` does not print them
        elif name.endswith("_std"):
            same(full, found, answer["std"].get(name.removesuffix("_std")))
        else:
            same(full, found, answer["values"].get(name))
        compared += 1
    # A bias of the accelerometer is the filter's own affair, no quantity that a controller asks for.
    groups = [it for it, of in ESTIMATORS.items() if of == estimator]
    given = {name.split(".")[1] for name in last if name.split(".")[0] in groups}
    printed = set(answer["values"]) - {"acceleration_bias_mps2"}
    assert printed <= given, f"{estimator}: {printed - given} is no output"

assert compared > 25, compared
estimated = [group for group in ESTIMATORS if identified[ESTIMATORS[group]]["status"] == "estimated"]
assert "resistance" in estimated, identified["train_kalman"]
print(f"FMPy: the FMU is valid; {len(signals)} steps, {compared} outputs as identified")
print(f"estimated: {', '.join(estimated)}")
