"""Prints what dynocar.py declares, in the words of the header test."""

import ctypes

import dynocar

STRUCTS = {
    "TrainSample": dynocar.TrainSample,
    "ParameterSnapshot": dynocar.ParameterSnapshot,
    "ReadingCopy": dynocar._Reading,
    "Resistance": dynocar._Resistance,
    "StopRequest": dynocar.StopRequest,
    "EffortPlace": dynocar.EffortPoint,
    "Stopping": dynocar.Stopping,
}
TYPES = {
    ctypes.c_int8: "i8",
    ctypes.c_uint8: "u8",
    ctypes.c_uint16: "u16",
    ctypes.c_int32: "i32",
    ctypes.c_uint32: "u32",
    ctypes.c_int64: "i64",
    ctypes.c_uint64: "u64",
    ctypes.c_double: "f64",
    dynocar.ParameterSnapshot: "ParameterSnapshot",
}
VOCABULARIES = {
    "CODE": dynocar.Code,
    "RAIL": dynocar.Rail,
    "DAEMON": dynocar.DaemonState,
    "STATUS": dynocar.Status,
    "REASON": dynocar.Reason,
    "PIPELINE": dynocar.PipelineKind,
    "QUANTITY": dynocar.Quantity,
    "PARAMETER": dynocar.Parameter,
    "REJECTED": dynocar.RejectionReason,
    "MANOEUVRE": dynocar.Manoeuvre,
    "EFFECT": dynocar.Effect,
    "HAS": dynocar.Has,
}

for name, struct in STRUCTS.items():
    print(name, "size", ctypes.sizeof(struct))
    for field, kind in struct._fields_:
        place = getattr(struct, field)
        element = getattr(kind, "_type_", kind) if issubclass(kind, ctypes.Array) else kind
        print(f"{name}.{field}", TYPES[element], place.offset, place.size)
for name, vocabulary in VOCABULARIES.items():
    for member in vocabulary:
        print(f"{name}_{member.name}", int(member))
print("SCHEMA", hex(dynocar.SCHEMA))
print("SAMPLE_LAYOUT", hex(dynocar.SAMPLE_LAYOUT))
print("SNAPSHOT_LAYOUT", hex(dynocar.SNAPSHOT_LAYOUT))
print("PARAMETERS_MAX", hex(dynocar.PARAMETERS_MAX))
print("COVARIANCE_ENTRIES", hex(dynocar.COVARIANCE_ENTRIES))
print("REJECTION_REASONS", hex(dynocar.REJECTION_REASONS))
