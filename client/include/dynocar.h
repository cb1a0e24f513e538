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
 * docs/guides/reading.md says which pipeline is for what, and what each status and each reason
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
 *     DYNOCAR_ERROR_WRONG_THREAD. Do not use a handle after closing it.
 *   - In a child made by fork() each call with a handle of the parent gives
 *     DYNOCAR_ERROR_FORKED_PROCESS and does nothing, closing included; the parent goes on as
 *     before. The child opens ends of its own.
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

/* What stands between generated: and end of generated is written from the library's own types
 * (client/tests/client/bindings.rs). */

/* ---- What this header was written for; see dynocar_header_matches_library() ---- */

/* generated: numbers */
#define DYNOCAR_SCHEMA 1u
#define DYNOCAR_SAMPLE_LAYOUT UINT64_C(0xdc0c8856b34a4c70)
#define DYNOCAR_SNAPSHOT_LAYOUT UINT64_C(0x9393d79d82bbec6)

#define DYNOCAR_PIPELINES_MAX 32 /* pipelines of one train */
#define DYNOCAR_PARAMETERS_MAX 6 /* parameters that one pipeline estimates together */
#define DYNOCAR_COVARIANCE_ENTRIES 21 /* of the lower triangle, packed by rows */
#define DYNOCAR_REJECTION_REASONS 16
/* end of generated */

#define DYNOCAR_MESSAGE_BYTES 512 /* room for any message; shorter buffers cut it */

/* ---- Vocabularies: numbers on the wire. A peer of a later release may send others. ---- */

/* generated: vocabularies */
/* What every function that can fail gives. */
typedef int32_t dynocar_code;
enum {
    DYNOCAR_OK = 0, /* Done */
    DYNOCAR_ERROR_NULL_ARGUMENT = 1, /* A pointer that must not be NULL is NULL */
    /* A number that means nothing or lies out of range, or that is not finite */
    DYNOCAR_ERROR_BAD_NUMBER = 2,
    DYNOCAR_ERROR_WRONG_THREAD = 3, /* The handle belongs to the thread that opened it */
    /* The root directory's name cannot be used: not absolute, too long, or special characters */
    DYNOCAR_ERROR_ROOT_NAME = 4,
    DYNOCAR_ERROR_DIRECTORY = 5, /* A run-time directory or file cannot be used */
    DYNOCAR_ERROR_OCCUPIED = 6, /* Another process drives the train */
    /* The daemon there speaks another schema, layout or transport version */
    DYNOCAR_ERROR_INCOMPATIBLE_DAEMON = 7,
    DYNOCAR_ERROR_TRANSPORT = 8, /* The shared memory cannot be used */
    DYNOCAR_ERROR_SEND_REFUSED = 9, /* The sample was not taken and counts as lost; just go on */
    DYNOCAR_ERROR_NO_SNAPSHOT = 10, /* No snapshot of this pipeline has come yet */
    /* The snapshot's pipeline does not estimate this parameter */
    DYNOCAR_ERROR_NOT_IN_SNAPSHOT = 11,
    /* A fault inside the library, in words on standard error: close the handle */
    DYNOCAR_ERROR_PANIC = 12,
    /* The train does not slow down, at the values given or at the edge of the bound */
    DYNOCAR_ERROR_DOES_NOT_STOP = 13,
    /* The daemon's configuration lets no pipeline answer this quantity for the train */
    DYNOCAR_ERROR_NOT_PROVIDED = 14,
    /* Every place of the train's channel is taken: close the ends that are no longer needed */
    DYNOCAR_ERROR_NO_PLACE_LEFT = 15,
    /* The handle was opened before fork(), in the parent: its ends are the parent's */
    DYNOCAR_ERROR_FORKED_PROCESS = 16,
    /* The root directory was removed or replaced: close all ends and open them again */
    DYNOCAR_ERROR_ROOT_GONE = 17,
    /* The daemon, or the controller, has a /dev/shm of its own: containers have to share one */
    DYNOCAR_ERROR_SEPARATE_MEMORY = 18
};

/* Who serves a train. */
enum {
    DYNOCAR_DAEMON_ABSENT = 0, /* Nobody serves the train */
    DYNOCAR_DAEMON_COMPATIBLE = 1, /* A living daemon serves it */
    /* A living daemon serves it, and we cannot understand each other */
    DYNOCAR_DAEMON_INCOMPATIBLE = 2
};

/* How the estimate of a pipeline stands as a whole. Of an estimated one, too, the reason may
 * remark something. */
enum {
    /* Some estimated values are not known yet; these are declared, kept or initial */
    DYNOCAR_STATUS_UNESTIMATED = 1,
    DYNOCAR_STATUS_ESTIMATED = 2, /* All that is estimated is known */
    DYNOCAR_STATUS_DEGRADED = 3, /* There are values, with a reservation named by the reason */
    DYNOCAR_STATUS_INVALID = 4 /* The values must not be used */
};

/* Whether a controller may use the values for what it asked for, in one word. */
enum {
    /* The values may be used, independent of the status of the estimate as a whole */
    DYNOCAR_USE_USABLE = 1,
    DYNOCAR_USE_LEARNING = 2, /* Not known well enough yet */
    /* Known, and held back until it has held for a while without doubt */
    DYNOCAR_USE_CONFIRMING = 3,
    DYNOCAR_USE_DOUBTED = 4, /* Something speaks against the values or the samples */
    /* There are no values: the daemon is silent, or the estimate has failed */
    DYNOCAR_USE_UNAVAILABLE = 5
};

/* Why a status is what it is. Of weak excitation, excited and missing_manoeuvres say more. */
enum {
    DYNOCAR_REASON_NONE = 0, /* Nothing to remark */
    DYNOCAR_REASON_TOO_FEW_SAMPLES = 1, /* Too few samples were used */
    /* Some parameter directions were not excited by the data */
    DYNOCAR_REASON_WEAK_EXCITATION = 2,
    DYNOCAR_REASON_AT_BOUND = 3, /* A parameter lies at a physical bound */
    /* The innovations are larger than their covariance says */
    DYNOCAR_REASON_INNOVATIONS_TOO_LARGE = 4,
    /* The innovations are correlated: the model lacks something */
    DYNOCAR_REASON_INNOVATIONS_NOT_WHITE = 5,
    DYNOCAR_REASON_BAD_INPUT = 6, /* A large share of the samples is rejected or lost */
    DYNOCAR_REASON_MISSING_QUANTITY = 7, /* The samples lack a quantity that the pipeline needs */
    /* No gradient is known: neither track nor sample gives one */
    DYNOCAR_REASON_GRADIENT_UNKNOWN = 8,
    DYNOCAR_REASON_NUMERICAL_FAILURE = 9, /* A factorisation failed; the filter was reset */
    /* The last manoeuvre that could excite the parameter lies too far back */
    DYNOCAR_REASON_ESTIMATE_STALE = 11,
    DYNOCAR_REASON_ONLY_LOWER_BOUND = 12, /* Only a lower bound can be had from these data */
    /* The same data fit other values of the parameters as well */
    DYNOCAR_REASON_NOT_IDENTIFIABLE = 13,
    /* The daemon has not been heard of lately; set by the client, never by the daemon */
    DYNOCAR_REASON_DAEMON_SILENT = 14,
    /* Forces that cannot be true: a wrong unit, exchanged, of the wrong sign, refreshed too
     * seldom */
    DYNOCAR_REASON_IMPLAUSIBLE_FORCES = 15,
    /* Speed, position, time or direction that contradict each other: a wrong unit or sign */
    DYNOCAR_REASON_IMPLAUSIBLE_MOTION = 16,
    DYNOCAR_REASON_IMPLAUSIBLE_MASS = 17, /* A mass that cannot be true: a wrong unit */
    /* A gradient that cannot be true: a wrong unit or sign */
    DYNOCAR_REASON_IMPLAUSIBLE_GRADIENT = 18,
    /* A brake-cylinder pressure that cannot be true: a wrong unit */
    DYNOCAR_REASON_IMPLAUSIBLE_PRESSURE = 19,
    /* The train stood so long that the load may have changed; its interval allows for that */
    DYNOCAR_REASON_LOAD_MAY_HAVE_CHANGED = 20
};

/* The kind of estimator behind a snapshot, named as in the configuration. */
enum {
    DYNOCAR_PIPELINE_LS = 1, /* Regularised least squares over all windows (Liu 2018, eq. 7) */
    DYNOCAR_PIPELINE_RLS = 2, /* Recursive least squares (Liu 2018, eq. 9-11) */
    /* Regularised recursive least squares (Liu 2018, eq. 12-16) */
    DYNOCAR_PIPELINE_REGULARISED_RLS = 3,
    DYNOCAR_PIPELINE_MILS = 4, /* Multi-innovation least squares, regularised (Liu 2018) */
    /* Interval-varying multi-innovation least squares, regularised (Liu 2018) */
    DYNOCAR_PIPELINE_V_MILS = 5,
    /* Trajectory fit by Wolfe-Newton over a sliding window (Xia 2023) */
    DYNOCAR_PIPELINE_TRAJECTORY_NEWTON = 10,
    DYNOCAR_PIPELINE_TRAJECTORY_KALMAN = 11, /* Kalman filter v, a, b, c with jump hypotheses */
    /* Robust resistance filter with a disturbance state */
    DYNOCAR_PIPELINE_RESISTANCE_KALMAN = 12,
    /* Adhesion by sliding-window expectation maximisation (Xie 2019) */
    DYNOCAR_PIPELINE_ADHESION_EM = 20,
    /* Adhesion by extended Kalman filter (the baseline of Xie 2019) */
    DYNOCAR_PIPELINE_ADHESION_EKF = 21,
    /* Adhesion by fixed-lag smoothing of the effective deceleration */
    DYNOCAR_PIPELINE_ADHESION_SMOOTHER = 22,
    DYNOCAR_PIPELINE_ADHESION_LAW = 23, /* Adhesion as the scale of a known law */
    /* Brake-disc friction times braking ratio by expectation maximisation (Jin 2020) */
    DYNOCAR_PIPELINE_BRAKE_EM = 30,
    /* Brake-disc friction times braking ratio by extended Kalman filter (Jin 2020's baseline) */
    DYNOCAR_PIPELINE_BRAKE_EKF = 31,
    /* Brake-disc friction times braking ratio by fixed-lag smoothing */
    DYNOCAR_PIPELINE_BRAKE_SMOOTHER = 32,
    /* Staged gradient descent for resistance and mass (Wang 2022) */
    DYNOCAR_PIPELINE_STAGED_DESCENT = 40,
    /* Joint integral least squares for resistance and mass */
    DYNOCAR_PIPELINE_JOINT_LEAST_SQUARES = 41,
    DYNOCAR_PIPELINE_MASS_KALMAN = 42, /* Kalman filter v, 1/m, bias for mass */
    DYNOCAR_PIPELINE_TRAIN_KALMAN = 43, /* Kalman filters of resistance and mass together */
    /* Watches the residual between model and measurement */
    DYNOCAR_PIPELINE_RESIDUAL_MONITOR = 50,
    /* Copies sample to snapshot without estimating: the latency floor */
    DYNOCAR_PIPELINE_ECHO = 60
};
#define DYNOCAR_PIPELINE_LEAST_SQUARES DYNOCAR_PIPELINE_LS /* its name in earlier releases */

/* What a controller asks for; the daemon's configuration says which pipeline answers. Where
 * the answer is: dynocar_snapshot_resistance() or Davis a, b and c; else the parameter MASS,
 * ADHESION or ADHESION_LOWER_BOUND, DISC_FRICTION, BRAKING_RATIO. */
enum {
    DYNOCAR_QUANTITY_RESISTANCE = 0, /* Basic resistance over speed: Davis a, b and c */
    DYNOCAR_QUANTITY_MASS = 1, /* Gross mass */
    DYNOCAR_QUANTITY_ADHESION = 2, /* Adhesion of wheel on rail */
    /* Friction of the brake discs, the declared braking ratio held */
    DYNOCAR_QUANTITY_BRAKE_FRICTION = 3,
    DYNOCAR_QUANTITY_BRAKING_RATIO = 4 /* Braking ratio, the declared friction held */
};

/* Where the mass in a snapshot comes from. */
enum {
    DYNOCAR_MASS_SOURCE_NONE = 0, /* The pipeline estimates no mass */
    /* The train's file: nothing else is known of the load yet */
    DYNOCAR_MASS_SOURCE_DECLARED = 1,
    DYNOCAR_MASS_SOURCE_WEIGHED = 2, /* The controller's samples, which carry it */
    DYNOCAR_MASS_SOURCE_LEARNED = 3 /* Effect of forces on the train */
};

/* A number that a pipeline estimates, with the unit of its value. A sample's mass is in kg. */
enum {
    DYNOCAR_PARAMETER_DAVIS_A = 1, /* Davis a in N/kN */
    DYNOCAR_PARAMETER_DAVIS_B = 2, /* Davis b in N/kN per m/s */
    DYNOCAR_PARAMETER_DAVIS_C = 3, /* Davis c in N/kN per (m/s)^2 */
    DYNOCAR_PARAMETER_MASS = 5, /* Mass in t */
    DYNOCAR_PARAMETER_ADHESION = 6, /* Wheel-rail adhesion coefficient */
    DYNOCAR_PARAMETER_ADHESION_LOWER_BOUND = 7, /* A lower bound of the adhesion coefficient */
    DYNOCAR_PARAMETER_ADHESION_LAW_SCALE = 8, /* Scale of the known adhesion law */
    DYNOCAR_PARAMETER_DISC_FRICTION = 9, /* Brake-disc friction coefficient */
    DYNOCAR_PARAMETER_BRAKING_RATIO = 10, /* Braking ratio */
    DYNOCAR_PARAMETER_ACCELERATION_BIAS = 14, /* Acceleration bias in m/s^2 */
    DYNOCAR_PARAMETER_UNEXPLAINED_FORCE = 15 /* Unexplained force in N */
};

/* Why a sample was not used: places in rejected_by_reason. */
enum {
    /* The time is not later than the last accepted one */
    DYNOCAR_REJECTED_TIME_NOT_INCREASING = 0,
    /* The time jumped ahead by more than a motion segment allows */
    DYNOCAR_REJECTED_TIME_JUMP = 1,
    /* The sequence number repeats or runs backwards */
    DYNOCAR_REJECTED_SEQUENCE_NOT_INCREASING = 2,
    DYNOCAR_REJECTED_WRONG_TRAIN = 3, /* The sample is of another train */
    DYNOCAR_REJECTED_MISSING = 4, /* A quantity that is needed is missing */
    DYNOCAR_REJECTED_NOT_FINITE = 5, /* A quantity is NaN or infinite */
    DYNOCAR_REJECTED_SPEED_OUT_OF_RANGE = 6, /* The speed lies outside the train's range */
    DYNOCAR_REJECTED_SPEED_JUMP = 7, /* The speed changed faster than a train can */
    /* The position disagrees with the speed or lies off the line */
    DYNOCAR_REJECTED_POSITION_JUMP = 8,
    /* A force lies outside the range that the train can exert */
    DYNOCAR_REJECTED_FORCE_OUT_OF_RANGE = 9,
    DYNOCAR_REJECTED_MASS_OUT_OF_RANGE = 10, /* The mass lies outside the train's range */
    DYNOCAR_REJECTED_BAD_DIRECTION = 11, /* The direction is neither +1 nor -1 */
    DYNOCAR_REJECTED_OUTLIER = 12, /* The estimator's outlier test refused the window */
    /* Wheel slide or wheel spin: the speed is not the train's */
    DYNOCAR_REJECTED_WHEEL_SLIDE = 13,
    DYNOCAR_REJECTED_OUT_OF_RANGE = 14, /* Another quantity lies outside its physical range */
    /* The sample before once more, or the same speed, place and forces of a moving train for
     * more than 2.5 s */
    DYNOCAR_REJECTED_REPEATED = 15
};

/* Manoeuvres that would show more: bits of missing_manoeuvres. */
enum {
    DYNOCAR_MANOEUVRE_COAST_SLOW = 1 << 0, /* Coasting at low speed, which determines Davis a */
    DYNOCAR_MANOEUVRE_COAST_FAST = 1 << 1, /* Coasting at high speed, which determines Davis c */
    /* A wider range of speeds, which separates a, b and c */
    DYNOCAR_MANOEUVRE_VARY_SPEED = 1 << 2,
    DYNOCAR_MANOEUVRE_ACCELERATE = 1 << 3, /* Strong traction, which determines mass */
    /* Strong braking, which determines adhesion and brake friction */
    DYNOCAR_MANOEUVRE_BRAKE = 1 << 4,
    DYNOCAR_MANOEUVRE_MOVE = 1 << 5 /* Any motion */
};

/* An effect that the model may lack. */
enum {
    DYNOCAR_EFFECT_NONE = 0, /* No suspicion */
    DYNOCAR_EFFECT_TUNNEL_DRAG = 1, /* Air drag in tunnels */
    DYNOCAR_EFFECT_CURVE_RESISTANCE = 2, /* Resistance in curves */
    DYNOCAR_EFFECT_WIND = 3, /* Wind along the line */
    DYNOCAR_EFFECT_DRAGGING_BRAKE = 4, /* A brake that does not release */
    DYNOCAR_EFFECT_WHEEL_DIAMETER = 5, /* A wrong wheel diameter, hence a wrong speed scale */
    DYNOCAR_EFFECT_GRADIENT_SHIFT = 6, /* A gradient profile moved along the line */
    DYNOCAR_EFFECT_MASS_CHANGE = 7, /* Another mass than declared */
    DYNOCAR_EFFECT_TRACTION_GAIN = 8, /* A reported force that is not the true one */
    DYNOCAR_EFFECT_ACTUATOR_DELAY = 9, /* Forces that act later than reported */
    DYNOCAR_EFFECT_ROTATING_MASS = 10, /* Another rotating mass than declared */
    DYNOCAR_EFFECT_BEARING_TEMPERATURE = 11, /* Cold bearings that warm up */
    DYNOCAR_EFFECT_AMBIENT_TEMPERATURE = 12, /* Resistance that follows the outside temperature */
    DYNOCAR_EFFECT_LOCAL_RESISTANCE = 13, /* Extra resistance at a place */
    DYNOCAR_EFFECT_LOW_ADHESION = 14, /* A brake force that the rail does not carry */
    DYNOCAR_EFFECT_UNKNOWN = 15, /* A real residual that no known effect explains */
    /* A declared gradient that is wrong by a smooth function of the chainage */
    DYNOCAR_EFFECT_GRADIENT_ERROR = 16,
    DYNOCAR_EFFECT_SPEED_DELAY = 17, /* A measured speed that is late */
    DYNOCAR_EFFECT_BRAKE_GAIN = 18, /* A brake that is weaker or stronger than reported */
    /* A brake that acts later than reported, while traction does not */
    DYNOCAR_EFFECT_BRAKE_DELAY = 19
};

/* Measured quantities of a sample: bits of valid. */
enum {
    DYNOCAR_HAS_POSITION = 1 << 0, /* position_m */
    DYNOCAR_HAS_SPEED = 1 << 1, /* speed_mps */
    DYNOCAR_HAS_TRACTION_FORCE = 1 << 2, /* traction_force_n */
    DYNOCAR_HAS_BRAKE_FORCE = 1 << 3, /* brake_force_n */
    DYNOCAR_HAS_BRAKE_CYLINDER_PRESSURE = 1 << 4, /* brake_cylinder_pressure_pa */
    DYNOCAR_HAS_ACCELERATION = 1 << 5, /* acceleration_mps2 */
    DYNOCAR_HAS_SPECIFIC_FORCE = 1 << 6, /* specific_force_mps2 */
    DYNOCAR_HAS_MASS = 1 << 7, /* mass_kg */
    DYNOCAR_HAS_AMBIENT_TEMPERATURE = 1 << 8, /* ambient_temperature_degc */
    DYNOCAR_HAS_GRADIENT = 1 << 9, /* gradient_permille */
    DYNOCAR_HAS_CURVE_RADIUS = 1 << 10 /* curve_radius_m */
};

#define DYNOCAR_FLAG_WHEEL_SLIDE 1 /* in flags: the wheel-slide protection is active */
/* end of generated */

/* ---- What a controller writes ---- */

/* generated: sample */
/* One cycle of a train. A field counts only while its bit in valid is set; start from
 * dynocar_sample_empty(). Missing values: leave the bit out; never write a made-up number.
 * published_ns, sequence, train_id and run are filled in by publish. */
typedef struct dynocar_train_sample {
    /* When the values were measured, in ns of the controller's monotonic clock */
    int64_t time_ns;
    /* When the sample was handed to the channel, in ns of the host's monotonic clock; the
     * publisher writes it, and latency is counted from it */
    int64_t published_ns;
    /* Counts the controller's samples, one by one; a gap means lost samples */
    uint64_t sequence;
    /* The train */
    uint64_t train_id;
    /* One bit for each DYNOCAR_HAS_... that holds a value */
    uint16_t valid;
    /* DYNOCAR_FLAG_WHEEL_SLIDE */
    uint8_t flags;
    /* +1 while the chainage grows in the direction of travel, -1 while it falls */
    int8_t direction;
    /* Number of the run (trip); filters start a new motion segment when it changes */
    uint32_t run;
    /* Chainage of the train's centre in m */
    double position_m;
    /* Speed in m/s, never negative */
    double speed_mps;
    /* Traction force in N, never negative */
    double traction_force_n;
    /* Brake force in N, retarding, never negative */
    double brake_force_n;
    /* Brake-cylinder pressure in Pa */
    double brake_cylinder_pressure_pa;
    /* dv/dt in m/s^2, as measured */
    double acceleration_mps2;
    /* Reading of an accelerometer along the track in m/s^2: dv/dt + g * gradient */
    double specific_force_mps2;
    /* The train's gross mass in kg, without the rotating part */
    double mass_kg;
    /* Outside temperature in degC */
    double ambient_temperature_degc;
    /* Gradient in permille, climbing positive as the chainage grows; for lines without a track
     * file */
    double gradient_permille;
    /* Curve radius in m, for lines without a track file; 0 on straight track */
    double curve_radius_m;
} dynocar_train_sample;
/* end of generated */

/* ---- What the daemon answers ---- */

/* generated: answers */
/* A pipeline's knowledge of one train at one moment. One bit for each X is 1 << X; model_hash
 * is as `dynocar models` names it. */
typedef struct dynocar_parameter_snapshot {
    /* Start of the daemon, in ns of the host's monotonic clock; grows with every restart */
    uint64_t epoch;
    /* Counts this pipeline's snapshots of this train within the epoch, from 1 */
    uint64_t sequence;
    /* Counts the resets of the estimate within the epoch */
    uint64_t generation;
    /* The train */
    uint64_t train_id;
    /* Number of the pipeline in the daemon's configuration */
    uint32_t pipeline_index;
    /* DYNOCAR_PIPELINE_... */
    uint32_t pipeline_kind;
    /* DYNOCAR_STATUS_... */
    uint32_t status;
    /* DYNOCAR_REASON_... */
    uint32_t reason;
    /* One bit for each DYNOCAR_QUANTITY_... that this pipeline answers for the train, by the
     * daemon's configuration */
    uint32_t quantities;
    /* One bit for each DYNOCAR_QUANTITY_... that any pipeline of the daemon answers for the
     * train */
    uint32_t train_quantities;
    /* Measurement time of the newest sample behind the snapshot, controller's clock, in ns */
    int64_t sample_time_ns;
    /* When that sample was handed to the channel, host's monotonic clock, in ns */
    int64_t sample_published_ns;
    /* When the snapshot was first handed to the channel, host's monotonic clock, in ns */
    int64_t published_ns;
    /* When the daemon last vouched for it, host's monotonic clock, in ns; a snapshot is sent
     * again from time to time while no sample comes */
    int64_t vouched_ns;
    /* Sequence number of the newest sample behind the snapshot */
    uint64_t sample_sequence;
    /* Samples that entered the estimate or its window */
    uint64_t samples_used;
    /* Samples refused, for any reason */
    uint64_t samples_rejected;
    /* Samples that never arrived, by gaps of the sequence number */
    uint64_t samples_lost;
    /* Windows or segments that updated the estimate */
    uint64_t updates;
    /* Samples refused, by DYNOCAR_REJECTED_... number */
    uint32_t rejected_by_reason[DYNOCAR_REJECTION_REASONS];
    /* Number of parameters in use */
    uint32_t parameter_count;
    /* One bit for each parameter that the data excited */
    uint32_t excited;
    /* Manoeuvres that would excite the others, see DYNOCAR_MANOEUVRE_... */
    uint32_t missing_manoeuvres;
    /* Suspected missing effect, DYNOCAR_EFFECT_... */
    uint32_t suspected_effect;
    /* Other effects that these data hardly distinguish from it: one bit for each
     * DYNOCAR_EFFECT_... */
    uint32_t suspected_alternatives;
    /* How long the suspicion has stood, in whole s of the controller's clock */
    uint32_t suspicion_age_s;
    /* DYNOCAR_PARAMETER_... */
    uint32_t parameters[DYNOCAR_PARAMETERS_MAX];
    /* Values in the parameters' units */
    double values[DYNOCAR_PARAMETERS_MAX];
    /* Covariance, lower triangle packed by rows: (0,0), (1,0), (1,1), (2,0), ... */
    double covariance[DYNOCAR_COVARIANCE_ENTRIES];
    /* Newest innovation over its predicted standard deviation */
    double innovation_normalised;
    /* Mean square of the normalised innovations lately; 1 when the model holds */
    double innovation_mean_square;
    /* Lag-1 correlation of the innovations lately; 0 when they are white */
    double innovation_correlation;
    /* Force in N, retarding positive, that the model does not explain */
    double unexplained_force_n;
    /* Its standard deviation in N */
    double unexplained_force_std_n;
    /* Evidence for the suspected effect: twice the log-likelihood ratio */
    double suspicion_evidence;
    /* Lowest speed in m/s among the data behind the estimate */
    double speed_min_mps;
    /* Highest speed in m/s among the data behind the estimate */
    double speed_max_mps;
    /* The model of train and line that the pipeline uses: the first 8 bytes of SHA-256 over
     * the train's file, a zero byte and the line's file; 0 when it came from no files */
    uint64_t model_hash;
    /* One bit for each DYNOCAR_QUANTITY_... whose values a controller may use now. It changes
     * seldom: a usable quantity stays usable for half a second of doubt, and a doubted one has
     * to hold for a while */
    uint32_t usable_quantities;
    /* Where the mass comes from: DYNOCAR_MASS_SOURCE_... */
    uint32_t mass_source;
} dynocar_parameter_snapshot;

/* A snapshot copied out, with its age. is_usable is for what was asked, by usable_quantities. */
typedef struct dynocar_reading {
    /* Time in ns since the daemon last vouched for the snapshot */
    int64_t age_ns;
    /* DYNOCAR_STATUS_...; invalid while the daemon is silent */
    uint32_t status;
    /* DYNOCAR_REASON_...; a number of a newer peer passes as it came */
    uint32_t reason;
    /* 1 when the daemon has been silent for too long, else 0 */
    uint32_t is_stale;
    /* 1 when a controller may use the values, else 0 */
    uint32_t is_usable;
    /* The snapshot as the daemon wrote it */
    dynocar_parameter_snapshot snapshot;
} dynocar_reading;

/* Basic resistance (no gradient, no curve) at a speed: w0(v) = a + b v + c v^2. */
typedef struct dynocar_resistance {
    /* Unit basic resistance w0 in N per kN of train weight */
    double w0_n_per_kn;
    /* Standard deviation of w0_n_per_kn */
    double w0_std_n_per_kn;
    /* The same in N, for the mass the caller gave */
    double force_n;
    /* Standard deviation of force_n, the mass taken as exact */
    double force_std_n;
    /* 1 when the speed lies outside the speeds behind the estimate, else 0 */
    uint64_t is_extrapolated;
} dynocar_resistance;
/* end of generated */

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

/* Takes the messages since the last poll, a bounded number. news may be NULL; it gets the number of
 * snapshots that brought something new. REAL-TIME */
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

/* The state of use of the request, DYNOCAR_USE_...; NULL is unavailable. REAL-TIME */
uint32_t dynocar_reading_use_state(const dynocar_reading *reading);

/* The reason for it, in one word: the reason behind the status, or "confirming" for values that are
 * known but held back until they have held for a while. Never NULL, never to be freed. REAL-TIME */
const char *dynocar_reading_why(const dynocar_reading *reading);

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

/* generated: stops */
/* What the rail carries in a stop. */
enum {
    /* Any brake force: adhesion and its standard deviation are not read */
    DYNOCAR_RAIL_UNLIMITED = 0,
    /* Adhesion is one coefficient at all speeds, or a lower bound of it */
    DYNOCAR_RAIL_COEFFICIENT = 1,
    DYNOCAR_RAIL_DRY_LAW = 2, /* Adhesion is a scale of the dry rail's law (Xie 2019) */
    DYNOCAR_RAIL_WET_LAW = 3 /* Adhesion is a scale of the wet rail's law (Xie 2019) */
};

/* The stop that is asked about. Set all to 0 first; standard deviations may stay 0. */
typedef struct dynocar_stop {
    /* Speed in m/s at which the brake is commanded */
    double from_speed_mps;
    /* Speed in m/s at which the stop is over; 0 for standstill */
    double to_speed_mps;
    /* Gross mass in kg, without the rotating part */
    double mass_kg;
    /* gamma: inertial mass = mass (1 + gamma) */
    double rotating_mass_factor;
    /* Gradient in permille along the direction of travel, climbing positive */
    double gradient_permille;
    /* Davis a in N/kN */
    double davis_a;
    /* Davis b in N/kN per m/s */
    double davis_b;
    /* Davis c in N/kN per (m/s)^2 */
    double davis_c;
    /* Standard deviation of w0 in N/kN */
    double w0_std_n_per_kn;
    /* Factor on the brake force, as estimated over declared friction; 1 for the declared */
    double brake_scale;
    /* Its standard deviation */
    double brake_scale_std;
    /* Time in s after the command until traction is cut off; it holds the speed till then */
    double traction_cut_off_s;
    /* Time in s after that without any force of traction or brake */
    double dead_time_s;
    /* Time in s over which the brake force then grows linearly to its full value */
    double build_up_s;
    /* Greatest growth in m/s³ of the deceleration by the brake; 0 for no limit */
    double jerk_limit_mps3;
    /* Standard deviation in s of the time that a stop loses until the brake acts in full */
    double response_std_s;
    /* Adhesion coefficient, or the scale of a law */
    double adhesion;
    /* Its standard deviation */
    double adhesion_std;
    /* Adhesion of the rail: a Rail */
    uint64_t rail;
} dynocar_stop;

/* A point of the brake-effort curve: linear between points, constant beyond the ends; speeds
 * increase. */
typedef struct dynocar_effort_point {
    /* Speed in m/s */
    double speed_mps;
    /* Brake force of the whole train in N */
    double force_n;
} dynocar_effort_point;

/* Distance and time of a stop. */
typedef struct dynocar_stopping {
    /* Distance in m with every quantity at its value */
    double distance_m;
    /* Time in s with every quantity at its value */
    double time_s;
    /* Distance in m that is not exceeded, with at least the chosen confidence */
    double distance_bound_m;
    /* Time in s that is not exceeded, with at least the chosen confidence */
    double time_bound_s;
} dynocar_stopping;
/* end of generated */

/* Distance and time of a stop. confidence: 0.5 up to below 1, for the bound, which moves every
 * uncertain quantity to its unfavourable side. effort: 1 to 1024 points.
 * DYNOCAR_ERROR_DOES_NOT_STOP when the train would not slow down; DYNOCAR_ERROR_BAD_NUMBER also for
 * a mass_kg that the brake alone would decelerate by more than 10 m/s² (a mass in t). REAL-TIME */
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
const char *dynocar_use_state_name(uint32_t use_state);
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

/* generated: places */
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

DYNOCAR_SIZE_(dynocar_stop, 152);
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
DYNOCAR_AT_(dynocar_stop, traction_cut_off_s, 88);
DYNOCAR_AT_(dynocar_stop, dead_time_s, 96);
DYNOCAR_AT_(dynocar_stop, build_up_s, 104);
DYNOCAR_AT_(dynocar_stop, jerk_limit_mps3, 112);
DYNOCAR_AT_(dynocar_stop, response_std_s, 120);
DYNOCAR_AT_(dynocar_stop, adhesion, 128);
DYNOCAR_AT_(dynocar_stop, adhesion_std, 136);
DYNOCAR_AT_(dynocar_stop, rail, 144);

DYNOCAR_SIZE_(dynocar_effort_point, 16);
DYNOCAR_AT_(dynocar_effort_point, speed_mps, 0);
DYNOCAR_AT_(dynocar_effort_point, force_n, 8);

DYNOCAR_SIZE_(dynocar_stopping, 32);
DYNOCAR_AT_(dynocar_stopping, distance_m, 0);
DYNOCAR_AT_(dynocar_stopping, time_s, 8);
DYNOCAR_AT_(dynocar_stopping, distance_bound_m, 16);
DYNOCAR_AT_(dynocar_stopping, time_bound_s, 24);
/* end of generated */

#undef DYNOCAR_AT_
#undef DYNOCAR_SIZE_
#undef DYNOCAR_ASSERT_
#endif

#endif /* DYNOCAR_H */
