/*
 * Dynocar's client library for C (C99 and later) and C++ (C++17 and later).
 *
 * A controller publishes one sample each control cycle and polls what the daemon has learned:
 *
 *     dynocar_publisher_publish(publisher, &sample);
 *     dynocar_reader_poll(reader, NULL);
 *     dynocar_reader_resistance(reader, now_ns, &reading);
 *     if (reading.is_usable) { ... } else { ... the controller's own parameters ... }
 *
 * docs/guides/reading.md tells which pipeline is for what, and what each status and each reason
 * means for a controller.
 *
 * Rules
 *
 *   - Calls marked REAL-TIME never wait for the daemon, take no lock and make no system call and
 *     no allocation; only publish allocates, once, under 128 bytes, freed before it returns. Two
 *     exceptions: when a process has come or gone, the next publish and the next poll connect or
 *     disconnect it; and while pipeline threads sleep (or for a publisher's first half second, in
 *     which it does not know who sleeps), a publish makes a system call to wake each of them.
 *     All other calls open files or shared memory: make them before the cycle starts.
 *   - A handle belongs to the thread that opened it; every other thread gets
 *     DYNOCAR_ERROR_WRONG_THREAD. Do not use a handle after fork() or after closing it.
 *   - One controller drives a train: a second publisher for the same train is refused.
 *   - A train's snapshots have 12 places. Each open reader takes one until it is closed or its
 *     process ends; so do the daemon's metrics and its kept estimates. When all are taken, opening
 *     gives DYNOCAR_ERROR_NO_PLACE_LEFT; readers that are open are not disturbed.
 *   - The daemon may start, die and come back at any time: nothing has to be reopened. While it
 *     is silent for longer than the stale limit (250 ms unless set otherwise), every reading is
 *     stale and not usable.
 *   - All functions check their pointers for NULL, none throws, and none installs a signal handler.
 *
 * Functions that can fail give DYNOCAR_OK (0) or a DYNOCAR_ERROR_...; then nothing was written
 * through the caller's pointers, except where said. Units are part of the names; forces are of the
 * whole train. mps = m/s, mps2 = m/s^2, permille = 0.001, ns = 1e-9 s.
 */
#ifndef DYNOCAR_H
#define DYNOCAR_H

#include <stddef.h>
#include <stdint.h>
#include <string.h>

#ifdef __cplusplus
extern "C" {
#endif

/* ---- What this header was written for; see dynocar_header_matches_library() ---- */

#define DYNOCAR_SCHEMA 1u
#define DYNOCAR_SAMPLE_LAYOUT UINT64_C(0xdc0c8856b34a4c70)
#define DYNOCAR_SNAPSHOT_LAYOUT UINT64_C(0x9393d79d82bbec6)

#define DYNOCAR_PIPELINES_MAX 32      /* pipelines of one train */
#define DYNOCAR_PARAMETERS_MAX 6      /* parameters that one pipeline estimates together */
#define DYNOCAR_COVARIANCE_ENTRIES 21 /* of the lower triangle, packed by rows */
#define DYNOCAR_REJECTION_REASONS 16
#define DYNOCAR_MESSAGE_BYTES 512     /* room for any message; shorter buffers cut it */

/* ---- Vocabularies: numbers on the wire. A peer of a later release may send others. ---- */

/* What every function that can fail gives. */
typedef int32_t dynocar_code;
enum {
    DYNOCAR_OK = 0,
    DYNOCAR_ERROR_NULL_ARGUMENT = 1,
    DYNOCAR_ERROR_BAD_NUMBER = 2,          /* means nothing, lies out of range or is not finite */
    DYNOCAR_ERROR_WRONG_THREAD = 3,        /* the handle was opened by another thread */
    DYNOCAR_ERROR_ROOT_NAME = 4,           /* not absolute, too long, or special characters */
    DYNOCAR_ERROR_DIRECTORY = 5,           /* a run-time directory or file cannot be used */
    DYNOCAR_ERROR_OCCUPIED = 6,            /* the train already has a controller */
    DYNOCAR_ERROR_INCOMPATIBLE_DAEMON = 7, /* another schema, layout or transport version */
    DYNOCAR_ERROR_TRANSPORT = 8,           /* the shared memory cannot be used */
    DYNOCAR_ERROR_SEND_REFUSED = 9,        /* the sample counts as lost; just go on */
    DYNOCAR_ERROR_NO_SNAPSHOT = 10,        /* none of this pipeline has come yet */
    DYNOCAR_ERROR_NOT_IN_SNAPSHOT = 11,    /* the pipeline does not estimate this parameter */
    DYNOCAR_ERROR_PANIC = 12,              /* a fault inside the library: close the handle */
    DYNOCAR_ERROR_DOES_NOT_STOP = 13,      /* the train does not slow down */
    DYNOCAR_ERROR_NOT_PROVIDED = 14,       /* no pipeline answers this quantity for the train */
    DYNOCAR_ERROR_NO_PLACE_LEFT = 15       /* all places of the train's channel are taken */
};

/* Who serves a train. */
enum {
    DYNOCAR_DAEMON_ABSENT = 0,
    DYNOCAR_DAEMON_COMPATIBLE = 1,
    DYNOCAR_DAEMON_INCOMPATIBLE = 2
};

/* What a controller asks for; the daemon's configuration says which pipeline answers. */
enum {
    DYNOCAR_QUANTITY_RESISTANCE = 0,     /* dynocar_snapshot_resistance(), or Davis a, b, c */
    DYNOCAR_QUANTITY_MASS = 1,           /* DYNOCAR_PARAMETER_MASS */
    DYNOCAR_QUANTITY_ADHESION = 2,       /* DYNOCAR_PARAMETER_ADHESION or ..._LOWER_BOUND */
    DYNOCAR_QUANTITY_BRAKE_FRICTION = 3, /* DYNOCAR_PARAMETER_DISC_FRICTION, the ratio held */
    DYNOCAR_QUANTITY_BRAKING_RATIO = 4   /* DYNOCAR_PARAMETER_BRAKING_RATIO, the friction held */
};

/* Where the mass in a snapshot comes from. */
enum {
    DYNOCAR_MASS_SOURCE_NONE = 0,     /* the pipeline estimates no mass */
    DYNOCAR_MASS_SOURCE_DECLARED = 1, /* the train's file */
    DYNOCAR_MASS_SOURCE_WEIGHED = 2,  /* the controller's samples */
    DYNOCAR_MASS_SOURCE_LEARNED = 3   /* what forces do to the train */
};

/* What a controller may do with an estimate. */
enum {
    DYNOCAR_STATUS_UNESTIMATED = 1, /* not enough data; values are declared or initial ones */
    DYNOCAR_STATUS_ESTIMATED = 2,   /* the values may be used; the reason may remark on them */
    DYNOCAR_STATUS_DEGRADED = 3,    /* there are values, with a reservation: see the reason */
    DYNOCAR_STATUS_INVALID = 4      /* the values must not be used */
};

/* Why a status is what it is. */
enum {
    DYNOCAR_REASON_NONE = 0,
    DYNOCAR_REASON_TOO_FEW_SAMPLES = 1,
    DYNOCAR_REASON_WEAK_EXCITATION = 2,       /* see excited and missing_manoeuvres */
    DYNOCAR_REASON_AT_BOUND = 3,              /* a parameter lies at a physical bound */
    DYNOCAR_REASON_INNOVATIONS_TOO_LARGE = 4, /* larger than their covariance says */
    DYNOCAR_REASON_INNOVATIONS_NOT_WHITE = 5, /* correlated: the model lacks something */
    DYNOCAR_REASON_BAD_INPUT = 6,             /* many samples are rejected or lost */
    DYNOCAR_REASON_MISSING_QUANTITY = 7,      /* the samples lack what the pipeline needs */
    DYNOCAR_REASON_GRADIENT_UNKNOWN = 8,      /* neither track nor sample gives one */
    DYNOCAR_REASON_NUMERICAL_FAILURE = 9,     /* the filter was reset */
    DYNOCAR_REASON_ESTIMATE_STALE = 11,       /* the last exciting manoeuvre is too long ago */
    DYNOCAR_REASON_ONLY_LOWER_BOUND = 12,     /* these data give no more */
    DYNOCAR_REASON_NOT_IDENTIFIABLE = 13,     /* other values of some parameters fit as well */
    DYNOCAR_REASON_DAEMON_SILENT = 14,        /* set by the client, never by the daemon */
    DYNOCAR_REASON_IMPLAUSIBLE_FORCES = 15,   /* a wrong unit, exchanged, of the wrong sign */
    DYNOCAR_REASON_IMPLAUSIBLE_MOTION = 16,   /* speed, position, time, direction: unit or sign */
    DYNOCAR_REASON_IMPLAUSIBLE_MASS = 17,     /* a wrong unit */
    DYNOCAR_REASON_IMPLAUSIBLE_GRADIENT = 18, /* a wrong unit or sign */
    DYNOCAR_REASON_IMPLAUSIBLE_PRESSURE = 19  /* a wrong unit */
};

/* The kind of estimator behind a snapshot, named as in the configuration. */
enum {
    DYNOCAR_PIPELINE_LS = 1,                 /* least squares, regularised (Liu 2018) */
    DYNOCAR_PIPELINE_RLS = 2,                /* recursive least squares (Liu 2018) */
    DYNOCAR_PIPELINE_REGULARISED_RLS = 3,    /* the same, regularised (Liu 2018) */
    DYNOCAR_PIPELINE_MILS = 4,               /* multi-innovation (Liu 2018) */
    DYNOCAR_PIPELINE_V_MILS = 5,             /* interval-varying multi-innovation (Liu 2018) */
    DYNOCAR_PIPELINE_TRAJECTORY_NEWTON = 10, /* sliding-window trajectory fit (Xia 2023) */
    DYNOCAR_PIPELINE_TRAJECTORY_KALMAN = 11, /* [v, a, b, c] with jump hypotheses */
    DYNOCAR_PIPELINE_RESISTANCE_KALMAN = 12, /* robust, with a disturbance state */
    DYNOCAR_PIPELINE_ADHESION_EM = 20,       /* expectation maximisation (Xie 2019) */
    DYNOCAR_PIPELINE_ADHESION_EKF = 21,      /* extended Kalman filter (baseline of Xie 2019) */
    DYNOCAR_PIPELINE_ADHESION_SMOOTHER = 22, /* fixed-lag smoothing */
    DYNOCAR_PIPELINE_ADHESION_LAW = 23,      /* scale of a known law */
    DYNOCAR_PIPELINE_BRAKE_EM = 30,          /* disc friction times ratio (Jin 2020) */
    DYNOCAR_PIPELINE_BRAKE_EKF = 31,         /* extended Kalman filter (baseline of Jin 2020) */
    DYNOCAR_PIPELINE_BRAKE_SMOOTHER = 32,    /* fixed-lag smoothing */
    DYNOCAR_PIPELINE_STAGED_DESCENT = 40,    /* resistance and mass (Wang 2022) */
    DYNOCAR_PIPELINE_JOINT_LEAST_SQUARES = 41, /* resistance and mass */
    DYNOCAR_PIPELINE_MASS_KALMAN = 42,       /* [v, 1/m, bias] */
    DYNOCAR_PIPELINE_TRAIN_KALMAN = 43,      /* resistance and mass as one estimate */
    DYNOCAR_PIPELINE_RESIDUAL_MONITOR = 50,  /* watches model against measurement */
    DYNOCAR_PIPELINE_ECHO = 60               /* estimates nothing: the latency floor */
};
#define DYNOCAR_PIPELINE_LEAST_SQUARES DYNOCAR_PIPELINE_LS /* its name in earlier releases */

/* A quantity that a pipeline estimates, with the unit of its value. */
enum {
    DYNOCAR_PARAMETER_DAVIS_A = 1,              /* N/kN */
    DYNOCAR_PARAMETER_DAVIS_B = 2,              /* N/kN per m/s */
    DYNOCAR_PARAMETER_DAVIS_C = 3,              /* N/kN per (m/s)^2 */
    DYNOCAR_PARAMETER_MASS = 5,                 /* t; a sample's mass is in kg */
    DYNOCAR_PARAMETER_ADHESION = 6,             /* 1, wheel on rail */
    DYNOCAR_PARAMETER_ADHESION_LOWER_BOUND = 7, /* 1 */
    DYNOCAR_PARAMETER_ADHESION_LAW_SCALE = 8,   /* 1 */
    DYNOCAR_PARAMETER_DISC_FRICTION = 9,        /* 1 */
    DYNOCAR_PARAMETER_BRAKING_RATIO = 10,       /* 1 */
    DYNOCAR_PARAMETER_ACCELERATION_BIAS = 14,   /* m/s^2 */
    DYNOCAR_PARAMETER_UNEXPLAINED_FORCE = 15    /* N */
};

/* Why a sample was not used: places in rejected_by_reason. */
enum {
    DYNOCAR_REJECTED_TIME_NOT_INCREASING = 0,
    DYNOCAR_REJECTED_TIME_JUMP = 1,
    DYNOCAR_REJECTED_SEQUENCE_NOT_INCREASING = 2,
    DYNOCAR_REJECTED_WRONG_TRAIN = 3,
    DYNOCAR_REJECTED_MISSING = 4,    /* a quantity that is needed */
    DYNOCAR_REJECTED_NOT_FINITE = 5, /* NaN or infinite */
    DYNOCAR_REJECTED_SPEED_OUT_OF_RANGE = 6,
    DYNOCAR_REJECTED_SPEED_JUMP = 7,    /* faster than a train can */
    DYNOCAR_REJECTED_POSITION_JUMP = 8, /* disagrees with the speed, or lies off the line */
    DYNOCAR_REJECTED_FORCE_OUT_OF_RANGE = 9,
    DYNOCAR_REJECTED_MASS_OUT_OF_RANGE = 10,
    DYNOCAR_REJECTED_BAD_DIRECTION = 11, /* neither +1 nor -1 */
    DYNOCAR_REJECTED_OUTLIER = 12,       /* by the estimator's own test */
    DYNOCAR_REJECTED_WHEEL_SLIDE = 13,   /* slide or spin: not the train's speed */
    DYNOCAR_REJECTED_OUT_OF_RANGE = 14,  /* another quantity */
    DYNOCAR_REJECTED_FROZEN = 15         /* in motion the same, place and all, for over 2.5 s */
};

/* Manoeuvres that would tell more: bits of missing_manoeuvres. */
enum {
    DYNOCAR_MANOEUVRE_COAST_SLOW = 1 << 0, /* tells of Davis a */
    DYNOCAR_MANOEUVRE_COAST_FAST = 1 << 1, /* tells of Davis c */
    DYNOCAR_MANOEUVRE_VARY_SPEED = 1 << 2, /* tells a, b and c apart */
    DYNOCAR_MANOEUVRE_ACCELERATE = 1 << 3, /* tells of mass */
    DYNOCAR_MANOEUVRE_BRAKE = 1 << 4,      /* tells of adhesion and brake friction */
    DYNOCAR_MANOEUVRE_MOVE = 1 << 5        /* any motion */
};

/* An effect that the model may lack. */
enum {
    DYNOCAR_EFFECT_NONE = 0,
    DYNOCAR_EFFECT_TUNNEL_DRAG = 1,
    DYNOCAR_EFFECT_CURVE_RESISTANCE = 2,
    DYNOCAR_EFFECT_WIND = 3,
    DYNOCAR_EFFECT_DRAGGING_BRAKE = 4,
    DYNOCAR_EFFECT_WHEEL_DIAMETER = 5,
    DYNOCAR_EFFECT_GRADIENT_SHIFT = 6, /* a profile moved along the line */
    DYNOCAR_EFFECT_MASS_CHANGE = 7,
    DYNOCAR_EFFECT_TRACTION_GAIN = 8,  /* a reported force that is not the true one */
    DYNOCAR_EFFECT_ACTUATOR_DELAY = 9, /* forces act later than reported */
    DYNOCAR_EFFECT_ROTATING_MASS = 10,
    DYNOCAR_EFFECT_BEARING_TEMPERATURE = 11,
    DYNOCAR_EFFECT_AMBIENT_TEMPERATURE = 12,
    DYNOCAR_EFFECT_LOCAL_RESISTANCE = 13,
    DYNOCAR_EFFECT_LOW_ADHESION = 14,
    DYNOCAR_EFFECT_UNKNOWN = 15, /* a real residual that no known effect explains */
    DYNOCAR_EFFECT_GRADIENT_ERROR = 16, /* a declared gradient that is wrong along the line */
    DYNOCAR_EFFECT_SPEED_DELAY = 17     /* a measured speed that is late */
};

/* Measured quantities: bits of valid. */
enum {
    DYNOCAR_HAS_POSITION = 1 << 0,
    DYNOCAR_HAS_SPEED = 1 << 1,
    DYNOCAR_HAS_TRACTION_FORCE = 1 << 2,
    DYNOCAR_HAS_BRAKE_FORCE = 1 << 3,
    DYNOCAR_HAS_BRAKE_CYLINDER_PRESSURE = 1 << 4,
    DYNOCAR_HAS_ACCELERATION = 1 << 5,
    DYNOCAR_HAS_SPECIFIC_FORCE = 1 << 6,
    DYNOCAR_HAS_MASS = 1 << 7,
    DYNOCAR_HAS_AMBIENT_TEMPERATURE = 1 << 8,
    DYNOCAR_HAS_GRADIENT = 1 << 9,
    DYNOCAR_HAS_CURVE_RADIUS = 1 << 10
};

#define DYNOCAR_FLAG_WHEEL_SLIDE 1 /* in flags: the wheel-slide protection is active */

/* ---- What a controller writes ---- */

/* One cycle of a train. A field counts only while its bit in valid is set; start from
 * dynocar_sample_empty(). Missing values: leave the bit out; never write a made-up number. */
typedef struct dynocar_train_sample {
    int64_t time_ns;      /* when measured, controller's monotonic clock */
    int64_t published_ns; /* filled in by publish: host's monotonic clock */
    uint64_t sequence;    /* filled in by publish: counts from 1; a gap tells of lost samples */
    uint64_t train_id;    /* filled in by publish */
    uint16_t valid;       /* DYNOCAR_HAS_... of every field that holds a value */
    uint8_t flags;        /* DYNOCAR_FLAG_WHEEL_SLIDE */
    int8_t direction;     /* +1 while the chainage grows in the direction of travel, else -1 */
    uint32_t run;         /* filled in by publish: number of the run (trip) */
    double position_m;    /* chainage of the train's centre */
    double speed_mps;     /* never negative */
    double traction_force_n; /* at the wheel rims, never negative */
    double brake_force_n;    /* retarding, never negative */
    double brake_cylinder_pressure_pa;
    double acceleration_mps2;        /* dv/dt, as measured */
    double specific_force_mps2;      /* accelerometer along the track: dv/dt + g * gradient */
    double mass_kg;                  /* gross, without the rotating part */
    double ambient_temperature_degc; /* outside */
    double gradient_permille; /* climbing positive as the chainage grows; if no track file */
    double curve_radius_m;    /* 0 on straight track; if no track file */
} dynocar_train_sample;

/* ---- What the daemon answers ---- */

/* A pipeline's knowledge of one train at one moment. */
typedef struct dynocar_parameter_snapshot {
    uint64_t epoch;      /* start of the daemon, host's monotonic ns: grows with every restart */
    uint64_t sequence;   /* counts the pipeline's snapshots within the epoch, from 1 */
    uint64_t generation; /* counts the estimate's resets within the epoch */
    uint64_t train_id;
    uint32_t pipeline_index; /* in the daemon's configuration */
    uint32_t pipeline_kind;  /* DYNOCAR_PIPELINE_... */
    uint32_t status;         /* DYNOCAR_STATUS_... as the daemon wrote it */
    uint32_t reason;         /* DYNOCAR_REASON_... as the daemon wrote it */
    uint32_t quantities;     /* 1 << DYNOCAR_QUANTITY_...: what this pipeline answers */
    uint32_t train_quantities; /* the same: what any pipeline answers for the train */

    int64_t sample_time_ns;      /* newest sample: when measured, controller's clock */
    int64_t sample_published_ns; /* newest sample: when published, host's monotonic clock */
    int64_t published_ns;        /* this snapshot: when first published, same clock */
    int64_t vouched_ns;          /* this snapshot: when last vouched for by the daemon, same clock */
    uint64_t sample_sequence;    /* newest sample: its number */

    uint64_t samples_used;
    uint64_t samples_rejected;
    uint64_t samples_lost; /* by gaps of the sequence number */
    uint64_t updates;      /* windows or segments that updated the estimate */
    uint32_t rejected_by_reason[DYNOCAR_REJECTION_REASONS]; /* by DYNOCAR_REJECTED_... */

    uint32_t parameter_count;    /* in use, at most DYNOCAR_PARAMETERS_MAX */
    uint32_t excited;            /* one bit for each parameter that the data excited */
    uint32_t missing_manoeuvres; /* DYNOCAR_MANOEUVRE_... that would excite the others */
    uint32_t suspected_effect;   /* DYNOCAR_EFFECT_... */
    uint32_t suspected_alternatives; /* 1 << DYNOCAR_EFFECT_...: hardly told from it */
    uint32_t suspicion_age_s;        /* s for which the suspicion has stood */
    uint32_t parameters[DYNOCAR_PARAMETERS_MAX];   /* DYNOCAR_PARAMETER_... */
    double values[DYNOCAR_PARAMETERS_MAX];         /* in the parameters' units */
    double covariance[DYNOCAR_COVARIANCE_ENTRIES]; /* (0,0), (1,0), (1,1), (2,0), ... */

    double innovation_normalised;   /* 1: newest innovation over its predicted deviation */
    double innovation_mean_square;  /* 1: of the normalised ones lately; 1 when the model holds */
    double innovation_correlation;  /* 1: lag 1, lately; 0 when white */
    double unexplained_force_n;     /* retarding positive */
    double unexplained_force_std_n; /* its standard deviation */
    double suspicion_evidence;      /* 1: twice the log-likelihood ratio of the suspicion */
    double speed_min_mps;           /* lowest speed behind the estimate */
    double speed_max_mps;           /* highest speed behind the estimate */
    uint64_t model_hash; /* of train and line, as `dynocar models` names it; 0: from no files */
    uint32_t usable_quantities; /* 1 << DYNOCAR_QUANTITY_...: what may be used, with hysteresis */
    uint32_t mass_source;       /* DYNOCAR_MASS_SOURCE_... */
} dynocar_parameter_snapshot;

/* A snapshot copied out, with its age. */
typedef struct dynocar_reading {
    int64_t age_ns;     /* since the daemon last vouched for the snapshot */
    uint32_t status;    /* DYNOCAR_STATUS_...; INVALID while the daemon is silent */
    uint32_t reason;    /* DYNOCAR_REASON_...; DAEMON_SILENT while the daemon is silent */
    uint32_t is_stale;  /* 1 when the daemon has been silent for too long */
    uint32_t is_usable; /* 1 when the values may be used for what was asked; see usable_quantities */
    dynocar_parameter_snapshot snapshot;
} dynocar_reading;

/* Basic resistance (no gradient, no curve) at a speed: w0(v) = a + b v + c v^2. */
typedef struct dynocar_resistance {
    double w0_n_per_kn;       /* N per kN of train weight */
    double w0_std_n_per_kn;   /* standard deviation, from the full covariance */
    double force_n;           /* w0 times the train's weight */
    double force_std_n;       /* standard deviation, the mass taken as exact */
    uint64_t is_extrapolated; /* 1 when the speed lies outside the speeds behind the estimate */
} dynocar_resistance;

/* ---- Publishing ---- */

typedef struct dynocar_publisher dynocar_publisher; /* opaque */

/* Opens the sample channel of a train; the daemon need not run yet.
 * root: run-time directory; NULL: the variable DYNOCAR_ROOT, else /tmp/dynocar-<user id>.
 * message: NULL, or message_size bytes for the error in words ("" after success).
 * On failure *publisher is NULL. */
dynocar_code dynocar_publisher_open(const char *root, uint64_t train_id,
                                    dynocar_publisher **publisher, char *message,
                                    size_t message_size);

/* Starts a new run (trip): filters do not integrate across. REAL-TIME */
dynocar_code dynocar_publisher_start_run(dynocar_publisher *publisher);

/* Publishes a sample, overwriting the oldest one where nobody reads. Fills in train_id, sequence,
 * run and published_ns, also when the transport refuses the sample. REAL-TIME */
dynocar_code dynocar_publisher_publish(dynocar_publisher *publisher, dynocar_train_sample *sample);

/* Waits until every pipeline has taken every sample, for at most patience_ns; *not_taken (or NULL)
 * is then how many of this publisher's samples the slowest has not taken. Not for the control
 * cycle. */
dynocar_code dynocar_publisher_flush(dynocar_publisher *publisher, int64_t patience_ns,
                                     uint64_t *not_taken);

/* Closes the publisher and gives the train free; NULL does nothing. Waits up to 0.2 s for the
 * pipelines to take what is on its way, unless dynocar_publisher_flush() has waited since the last
 * sample; the daemon counts the rest as lost. Not for the control cycle. */
dynocar_code dynocar_publisher_close(dynocar_publisher *publisher);

/* ---- Polling ---- */

typedef struct dynocar_reader dynocar_reader; /* opaque */

/* Opens the snapshot channel of a train; arguments as in dynocar_publisher_open(). */
dynocar_code dynocar_reader_open(const char *root, uint64_t train_id, dynocar_reader **reader,
                                 char *message, size_t message_size);

/* Sets the age (> 0) from which a snapshot counts as stale; 250 ms at first. REAL-TIME */
dynocar_code dynocar_reader_set_stale_after_ns(dynocar_reader *reader, int64_t stale_after_ns);

/* Takes what has come since the last poll: a bounded number of messages. news may be NULL; it
 * gets the number of snapshots that told something new. REAL-TIME */
dynocar_code dynocar_reader_poll(dynocar_reader *reader, uint32_t *news);

/* Copies the newest polled snapshot of the pipeline that answers a quantity (DYNOCAR_QUANTITY_...);
 * dynocar_reader_resistance() and the like below are short for it.
 * now_ns: dynocar_monotonic_now_ns(). On failure the reading is stale and not usable:
 * DYNOCAR_ERROR_NO_SNAPSHOT before the first, DYNOCAR_ERROR_NOT_PROVIDED when the daemon is there
 * and its configuration lets no pipeline answer. REAL-TIME */
dynocar_code dynocar_reader_quantity(dynocar_reader *reader, uint32_t quantity, int64_t now_ns,
                                     dynocar_reading *reading);

/* The same, of the first pipeline of a kind (DYNOCAR_PIPELINE_...). REAL-TIME */
dynocar_code dynocar_reader_latest(dynocar_reader *reader, uint32_t pipeline_kind, int64_t now_ns,
                                   dynocar_reading *reading);

/* The same, by the pipeline's number in the daemon's configuration. REAL-TIME */
dynocar_code dynocar_reader_latest_by_index(dynocar_reader *reader, uint32_t pipeline_index,
                                            int64_t now_ns, dynocar_reading *reading);

/* Counts messages that no sane daemon would send: foreign train, NaN, ... REAL-TIME */
dynocar_code dynocar_reader_refused(dynocar_reader *reader, uint64_t *count);

/* Closes the reader; NULL does nothing. */
dynocar_code dynocar_reader_close(dynocar_reader *reader);

/* ---- Reading a snapshot; no handle, any thread ---- */

/* Resistance at a finite speed for a train of mass_kg (>= 0; 0 when only w0 is wanted).
 * DYNOCAR_ERROR_NOT_IN_SNAPSHOT unless the pipeline estimates all three of a, b, c. REAL-TIME */
dynocar_code dynocar_snapshot_resistance(const dynocar_parameter_snapshot *snapshot,
                                         double speed_mps, double mass_kg,
                                         dynocar_resistance *resistance);

/* A parameter's value and standard deviation (may be NULL) in its unit. REAL-TIME */
dynocar_code dynocar_snapshot_value(const dynocar_parameter_snapshot *snapshot,
                                    uint32_t parameter, double *value, double *std);

/* Covariance of two parameters in the product of their units. REAL-TIME */
dynocar_code dynocar_snapshot_covariance(const dynocar_parameter_snapshot *snapshot,
                                         uint32_t parameter, uint32_t other, double *covariance);

/* ---- Braking distance and time; no handle, any thread ---- */

/* What the rail carries: rail of a dynocar_stop. */
enum {
    DYNOCAR_RAIL_UNLIMITED = 0,   /* any brake force; adhesion is not read */
    DYNOCAR_RAIL_COEFFICIENT = 1, /* adhesion is one coefficient at all speeds, or a lower bound */
    DYNOCAR_RAIL_DRY_LAW = 2,     /* adhesion is a scale of the dry rail's law (Xie 2019) */
    DYNOCAR_RAIL_WET_LAW = 3      /* adhesion is a scale of the wet rail's law (Xie 2019) */
};

/* The stop that is asked about. Set all to 0 first; standard deviations may stay 0. */
typedef struct {
    double from_speed_mps;       /* the brakes act in full from this speed on */
    double to_speed_mps;         /* 0 for standstill */
    double mass_kg;              /* without the rotating part */
    double rotating_mass_factor; /* gamma: inertial mass = mass (1 + gamma) */
    double gradient_permille;    /* along the travel, climbing positive */
    double davis_a;              /* N/kN */
    double davis_b;              /* N/kN per m/s */
    double davis_c;              /* N/kN per (m/s)^2 */
    double w0_std_n_per_kn;      /* as dynocar_snapshot_resistance() gives it */
    double brake_scale;          /* factor on the effort: estimated over declared friction, or 1 */
    double brake_scale_std;
    double adhesion;             /* by rail: coefficient or scale of a law */
    double adhesion_std;
    uint64_t rail;               /* DYNOCAR_RAIL_... */
} dynocar_stop;

/* A point of the brake-effort curve: linear between points, constant beyond the ends. */
typedef struct {
    double speed_mps; /* increasing */
    double force_n;   /* of the whole train at the wheel rims */
} dynocar_effort_point;

typedef struct {
    double distance_m; /* with every quantity at its value */
    double time_s;
    double distance_bound_m; /* not exceeded, with at least the confidence asked for */
    double time_bound_s;
} dynocar_stopping;

/* Distance and time of a stop. confidence: 0.5 up to below 1, for the bound, which moves every
 * uncertain quantity to its unfavourable side. effort: 1 to 1024 points.
 * DYNOCAR_ERROR_DOES_NOT_STOP when the train would not slow down. REAL-TIME */
dynocar_code dynocar_stopping_estimate(const dynocar_stop *stop,
                                       const dynocar_effort_point *effort, size_t effort_count,
                                       double confidence, dynocar_stopping *stopping);

/* ---- About ---- */

/* Who serves a train: state gets DYNOCAR_DAEMON_..., message says it in words, root and message as
 * in dynocar_publisher_open(). Opens files: not for the control cycle. */
dynocar_code dynocar_daemon_state(const char *root, uint64_t train_id, int32_t *state,
                                  char *message, size_t message_size);

/* The host's monotonic clock in ns since boot. REAL-TIME */
int64_t dynocar_monotonic_now_ns(void);

/* Names, never NULL, never to be freed; also for numbers that this release does not know.
 * REAL-TIME */
const char *dynocar_code_text(dynocar_code code);
const char *dynocar_pipeline_name(uint32_t kind);
const char *dynocar_quantity_name(uint32_t quantity);
const char *dynocar_mass_source_name(uint32_t mass_source);
const char *dynocar_parameter_name(uint32_t parameter);
const char *dynocar_status_name(uint32_t status);
const char *dynocar_reason_name(uint32_t reason);
const char *dynocar_rejection_name(uint32_t reason);
const char *dynocar_manoeuvre_name(uint32_t bit);
const char *dynocar_effect_name(uint32_t effect);

/* The library's release, schema and layouts. REAL-TIME */
const char *dynocar_version(void);
uint32_t dynocar_schema(void);
uint64_t dynocar_sample_layout(void);
uint64_t dynocar_snapshot_layout(void);

/* ---- Helpers in the header ---- */

/* 1 when the library maps the very structs that this header declares; check it once at start. */
static inline int dynocar_header_matches_library(void)
{
    return dynocar_schema() == DYNOCAR_SCHEMA && dynocar_sample_layout() == DYNOCAR_SAMPLE_LAYOUT
           && dynocar_snapshot_layout() == DYNOCAR_SNAPSHOT_LAYOUT;
}

/* A sample without any measured value, in direction +1. REAL-TIME */
static inline dynocar_train_sample dynocar_sample_empty(void)
{
    dynocar_train_sample sample;
    memset(&sample, 0, sizeof sample);
    sample.direction = 1;
    return sample;
}

/* dynocar_reader_quantity() by the quantity's name. REAL-TIME */
static inline dynocar_code dynocar_reader_resistance(dynocar_reader *reader, int64_t now_ns,
                                                     dynocar_reading *reading)
{
    return dynocar_reader_quantity(reader, DYNOCAR_QUANTITY_RESISTANCE, now_ns, reading);
}

static inline dynocar_code dynocar_reader_mass(dynocar_reader *reader, int64_t now_ns,
                                               dynocar_reading *reading)
{
    return dynocar_reader_quantity(reader, DYNOCAR_QUANTITY_MASS, now_ns, reading);
}

static inline dynocar_code dynocar_reader_adhesion(dynocar_reader *reader, int64_t now_ns,
                                                   dynocar_reading *reading)
{
    return dynocar_reader_quantity(reader, DYNOCAR_QUANTITY_ADHESION, now_ns, reading);
}

static inline dynocar_code dynocar_reader_brake_friction(dynocar_reader *reader, int64_t now_ns,
                                                         dynocar_reading *reading)
{
    return dynocar_reader_quantity(reader, DYNOCAR_QUANTITY_BRAKE_FRICTION, now_ns, reading);
}

static inline dynocar_code dynocar_reader_braking_ratio(dynocar_reader *reader, int64_t now_ns,
                                                        dynocar_reading *reading)
{
    return dynocar_reader_quantity(reader, DYNOCAR_QUANTITY_BRAKING_RATIO, now_ns, reading);
}

#ifdef __cplusplus
}
#endif

/* ---- The compiler checks what the library counts on ---- */

#if defined(__cplusplus)
#define DYNOCAR_ASSERT_(condition, message) static_assert(condition, message)
#elif defined(__STDC_VERSION__) && __STDC_VERSION__ >= 201112L
#define DYNOCAR_ASSERT_(condition, message) _Static_assert(condition, message)
#endif

#ifdef DYNOCAR_ASSERT_
#define DYNOCAR_AT_(type, field, place) \
    DYNOCAR_ASSERT_(offsetof(type, field) == (place), #type "." #field " lies elsewhere")
#define DYNOCAR_SIZE_(type, size) \
    DYNOCAR_ASSERT_(sizeof(type) == (size), #type " has another size")

DYNOCAR_SIZE_(dynocar_train_sample, 128);
DYNOCAR_AT_(dynocar_train_sample, time_ns, 0);
DYNOCAR_AT_(dynocar_train_sample, published_ns, 8);
DYNOCAR_AT_(dynocar_train_sample, sequence, 16);
DYNOCAR_AT_(dynocar_train_sample, train_id, 24);
DYNOCAR_AT_(dynocar_train_sample, valid, 32);
DYNOCAR_AT_(dynocar_train_sample, flags, 34);
DYNOCAR_AT_(dynocar_train_sample, direction, 35);
DYNOCAR_AT_(dynocar_train_sample, run, 36);
DYNOCAR_AT_(dynocar_train_sample, position_m, 40);
DYNOCAR_AT_(dynocar_train_sample, speed_mps, 48);
DYNOCAR_AT_(dynocar_train_sample, traction_force_n, 56);
DYNOCAR_AT_(dynocar_train_sample, brake_force_n, 64);
DYNOCAR_AT_(dynocar_train_sample, brake_cylinder_pressure_pa, 72);
DYNOCAR_AT_(dynocar_train_sample, acceleration_mps2, 80);
DYNOCAR_AT_(dynocar_train_sample, specific_force_mps2, 88);
DYNOCAR_AT_(dynocar_train_sample, mass_kg, 96);
DYNOCAR_AT_(dynocar_train_sample, ambient_temperature_degc, 104);
DYNOCAR_AT_(dynocar_train_sample, gradient_permille, 112);
DYNOCAR_AT_(dynocar_train_sample, curve_radius_m, 120);

DYNOCAR_SIZE_(dynocar_parameter_snapshot, 536);
DYNOCAR_AT_(dynocar_parameter_snapshot, epoch, 0);
DYNOCAR_AT_(dynocar_parameter_snapshot, sequence, 8);
DYNOCAR_AT_(dynocar_parameter_snapshot, generation, 16);
DYNOCAR_AT_(dynocar_parameter_snapshot, train_id, 24);
DYNOCAR_AT_(dynocar_parameter_snapshot, pipeline_index, 32);
DYNOCAR_AT_(dynocar_parameter_snapshot, pipeline_kind, 36);
DYNOCAR_AT_(dynocar_parameter_snapshot, status, 40);
DYNOCAR_AT_(dynocar_parameter_snapshot, reason, 44);
DYNOCAR_AT_(dynocar_parameter_snapshot, quantities, 48);
DYNOCAR_AT_(dynocar_parameter_snapshot, train_quantities, 52);
DYNOCAR_AT_(dynocar_parameter_snapshot, sample_time_ns, 56);
DYNOCAR_AT_(dynocar_parameter_snapshot, sample_published_ns, 64);
DYNOCAR_AT_(dynocar_parameter_snapshot, published_ns, 72);
DYNOCAR_AT_(dynocar_parameter_snapshot, vouched_ns, 80);
DYNOCAR_AT_(dynocar_parameter_snapshot, sample_sequence, 88);
DYNOCAR_AT_(dynocar_parameter_snapshot, samples_used, 96);
DYNOCAR_AT_(dynocar_parameter_snapshot, samples_rejected, 104);
DYNOCAR_AT_(dynocar_parameter_snapshot, samples_lost, 112);
DYNOCAR_AT_(dynocar_parameter_snapshot, updates, 120);
DYNOCAR_AT_(dynocar_parameter_snapshot, rejected_by_reason, 128);
DYNOCAR_AT_(dynocar_parameter_snapshot, parameter_count, 192);
DYNOCAR_AT_(dynocar_parameter_snapshot, excited, 196);
DYNOCAR_AT_(dynocar_parameter_snapshot, missing_manoeuvres, 200);
DYNOCAR_AT_(dynocar_parameter_snapshot, suspected_effect, 204);
DYNOCAR_AT_(dynocar_parameter_snapshot, suspected_alternatives, 208);
DYNOCAR_AT_(dynocar_parameter_snapshot, suspicion_age_s, 212);
DYNOCAR_AT_(dynocar_parameter_snapshot, parameters, 216);
DYNOCAR_AT_(dynocar_parameter_snapshot, values, 240);
DYNOCAR_AT_(dynocar_parameter_snapshot, covariance, 288);
DYNOCAR_AT_(dynocar_parameter_snapshot, innovation_normalised, 456);
DYNOCAR_AT_(dynocar_parameter_snapshot, innovation_mean_square, 464);
DYNOCAR_AT_(dynocar_parameter_snapshot, innovation_correlation, 472);
DYNOCAR_AT_(dynocar_parameter_snapshot, unexplained_force_n, 480);
DYNOCAR_AT_(dynocar_parameter_snapshot, unexplained_force_std_n, 488);
DYNOCAR_AT_(dynocar_parameter_snapshot, suspicion_evidence, 496);
DYNOCAR_AT_(dynocar_parameter_snapshot, speed_min_mps, 504);
DYNOCAR_AT_(dynocar_parameter_snapshot, speed_max_mps, 512);
DYNOCAR_AT_(dynocar_parameter_snapshot, model_hash, 520);
DYNOCAR_AT_(dynocar_parameter_snapshot, usable_quantities, 528);
DYNOCAR_AT_(dynocar_parameter_snapshot, mass_source, 532);

DYNOCAR_SIZE_(dynocar_reading, 560);
DYNOCAR_AT_(dynocar_reading, age_ns, 0);
DYNOCAR_AT_(dynocar_reading, status, 8);
DYNOCAR_AT_(dynocar_reading, reason, 12);
DYNOCAR_AT_(dynocar_reading, is_stale, 16);
DYNOCAR_AT_(dynocar_reading, is_usable, 20);
DYNOCAR_AT_(dynocar_reading, snapshot, 24);

DYNOCAR_SIZE_(dynocar_resistance, 40);
DYNOCAR_AT_(dynocar_resistance, w0_n_per_kn, 0);
DYNOCAR_AT_(dynocar_resistance, w0_std_n_per_kn, 8);
DYNOCAR_AT_(dynocar_resistance, force_n, 16);
DYNOCAR_AT_(dynocar_resistance, force_std_n, 24);
DYNOCAR_AT_(dynocar_resistance, is_extrapolated, 32);

DYNOCAR_SIZE_(dynocar_stop, 112);
DYNOCAR_AT_(dynocar_stop, from_speed_mps, 0);
DYNOCAR_AT_(dynocar_stop, to_speed_mps, 8);
DYNOCAR_AT_(dynocar_stop, mass_kg, 16);
DYNOCAR_AT_(dynocar_stop, rotating_mass_factor, 24);
DYNOCAR_AT_(dynocar_stop, gradient_permille, 32);
DYNOCAR_AT_(dynocar_stop, davis_a, 40);
DYNOCAR_AT_(dynocar_stop, davis_b, 48);
DYNOCAR_AT_(dynocar_stop, davis_c, 56);
DYNOCAR_AT_(dynocar_stop, w0_std_n_per_kn, 64);
DYNOCAR_AT_(dynocar_stop, brake_scale, 72);
DYNOCAR_AT_(dynocar_stop, brake_scale_std, 80);
DYNOCAR_AT_(dynocar_stop, adhesion, 88);
DYNOCAR_AT_(dynocar_stop, adhesion_std, 96);
DYNOCAR_AT_(dynocar_stop, rail, 104);

DYNOCAR_SIZE_(dynocar_effort_point, 16);
DYNOCAR_AT_(dynocar_effort_point, speed_mps, 0);
DYNOCAR_AT_(dynocar_effort_point, force_n, 8);

DYNOCAR_SIZE_(dynocar_stopping, 32);
DYNOCAR_AT_(dynocar_stopping, distance_m, 0);
DYNOCAR_AT_(dynocar_stopping, time_s, 8);
DYNOCAR_AT_(dynocar_stopping, distance_bound_m, 16);
DYNOCAR_AT_(dynocar_stopping, time_bound_s, 24);

#undef DYNOCAR_AT_
#undef DYNOCAR_SIZE_
#undef DYNOCAR_ASSERT_
#endif

#endif /* DYNOCAR_H */
