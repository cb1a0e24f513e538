/* A driver on a simulated train: put your own controller in its place, and see what it gains.
 *
 * driver [train id] [legs]
 * drives that many legs of 6 km by the timetable, many times faster than real time, and says after each
 * how late it came, how far beyond the stopping point it stands, and by which parameters it drove. With
 * "dynocar run --config config/daemon.toml" beside it, it drives by what the daemon learns.
 * README.md beside this folder says how to build it. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "dynocar.h"

#define CYCLE_S 0.2
#define PATIENCE_NS 50000000
#define LEG_M 6000.0
#define DUE_S 450.0
#define CRUISE_MPS 19.0
#define COASTING_MIN_MPS 15.0
#define BRAKING_MPS2 0.25
#define GAIN_PER_S 0.3
/* The train of config/demo/train.toml, which config/daemon.toml serves as train 1. */
#define TRACTION_N 300e3
#define BRAKE_N 1216e3
#define SLEW_N_PER_S 150e3
#define ROTATING_MASS_FACTOR 0.04

typedef struct {
    double mass_kg;
    double davis[3];
    int is_learned;
} parameters;

static const parameters BUILT_IN = {1799200.0, {1.498, 0.0147, 0.00086}, 0};
/* What nobody declared: another load, and more resistance. */
static const parameters TRUTH = {2050000.0, {2.1, 0.019, 0.00115}, 0};

/* Place in m, speed in m/s, force in N. */
typedef struct {
    double at_m;
    double speed_mps;
    double force_n;
} train;

static double clamped(double value, double least, double most)
{
    return value < least ? least : value > most ? most : value;
}

/* Force in N, braking negative, for an acceleration in m/s² on the level. */
static double force_n(const parameters *known, double acceleration_mps2, double speed_mps)
{
    double w0_n_per_kn =
        known->davis[0] + speed_mps * (known->davis[1] + speed_mps * known->davis[2]);
    double resistance_n = w0_n_per_kn * known->mass_kg * 9.81 / 1000.0;
    return known->mass_kg * (1.0 + ROTATING_MASS_FACTOR) * acceleration_mps2 + resistance_n;
}

static void step(train *it, double wanted_n, const parameters *known)
{
    double most_n = SLEW_N_PER_S * CYCLE_S;
    double next_n = clamped(wanted_n, it->force_n - most_n, it->force_n + most_n);
    double before_mps = it->speed_mps;
    double free_n = 0.5 * (it->force_n + next_n) - force_n(known, 0.0, before_mps);
    double gained_mps = CYCLE_S * (free_n / (known->mass_kg * (1.0 + ROTATING_MASS_FACTOR)));
    it->speed_mps = before_mps + gained_mps > 0.0 ? before_mps + gained_mps : 0.0;
    it->at_m += 0.5 * CYCLE_S * (before_mps + it->speed_mps);
    it->force_n = next_n;
}

/* Your controller: the force in N, braking negative, at a place with a speed, by what is known. */
static double controller_n(const train *it, double coast_from_m, const parameters *known)
{
    double left_m = LEG_M > it->at_m ? LEG_M - it->at_m : 0.0;
    double curve_mps = sqrt(2.0 * BRAKING_MPS2 * left_m);
    int brakes = it->speed_mps + 0.5 >= curve_mps && it->at_m > 0.5 * LEG_M;
    int coasts = it->at_m >= coast_from_m;
    if (!brakes && coasts && it->speed_mps > COASTING_MIN_MPS) {
        return 0.0;
    }
    double target_mps = coasts ? COASTING_MIN_MPS : CRUISE_MPS;
    double acceleration_mps2 = brakes ? GAIN_PER_S * (curve_mps - it->speed_mps) - BRAKING_MPS2
                                      : GAIN_PER_S * (target_mps - it->speed_mps);
    return clamped(force_n(known, acceleration_mps2, it->speed_mps), -BRAKE_N, TRACTION_N);
}

/* Running time in s by what is known. */
static double predicted_s(double coast_from_m, const parameters *known)
{
    train it = {0.0, 0.0, 0.0};
    double time_s = 0.0;
    while (time_s < 2.0 * DUE_S && (it.at_m < 1.0 || it.speed_mps > 0.0)) {
        step(&it, controller_n(&it, coast_from_m, known), known);
        time_s += CYCLE_S;
    }
    return time_s;
}

/* The first place in m from which coasting still keeps the timetable, by what is known. */
static double coasting_place_m(const parameters *known)
{
    double early_m = 0.1 * LEG_M;
    double late_m = LEG_M;
    for (int halving = 0; halving < 20; halving++) {
        double middle_m = 0.5 * (early_m + late_m);
        if (predicted_s(middle_m, known) <= DUE_S) {
            late_m = middle_m;
        } else {
            early_m = middle_m;
        }
    }
    return late_m;
}

/* What may be used of the daemon's answers, else the built-in parameters. */
static parameters learned(dynocar_reader *reader)
{
    static const uint32_t DAVIS[] = {DYNOCAR_PARAMETER_DAVIS_A, DYNOCAR_PARAMETER_DAVIS_B,
                                     DYNOCAR_PARAMETER_DAVIS_C};
    parameters known = BUILT_IN;
    dynocar_reading reading;
    double mass_t;
    if (dynocar_reader_mass(reader, dynocar_monotonic_now_ns(), &reading) == DYNOCAR_OK
        && reading.is_usable
        && dynocar_snapshot_value(&reading.snapshot, DYNOCAR_PARAMETER_MASS, &mass_t, NULL)
               == DYNOCAR_OK) {
        known.mass_kg = 1000.0 * mass_t;
        known.is_learned = 1;
    }
    if (dynocar_reader_resistance(reader, dynocar_monotonic_now_ns(), &reading) == DYNOCAR_OK
        && reading.is_usable) {
        for (int place = 0; place < 3; place++) {
            (void)dynocar_snapshot_value(&reading.snapshot, DAVIS[place], &known.davis[place], NULL);
        }
        known.is_learned = 1;
    }
    return known;
}

static void drive(dynocar_publisher *publisher, dynocar_reader *reader, int leg, int64_t *time_ns)
{
    train it = {0.0, 0.0, 0.0};
    (void)dynocar_publisher_start_run(publisher);
    (void)dynocar_reader_poll(reader, NULL);
    parameters known = learned(reader);
    double coast_from_m = coasting_place_m(&known);
    long cycles = 0;
    while (cycles == 0 || it.at_m < 1.0 || it.speed_mps > 0.0) {
        dynocar_train_sample sample = dynocar_sample_empty();
        *time_ns += (int64_t)(1e9 * CYCLE_S);
        sample.time_ns = *time_ns;
        sample.speed_mps = it.speed_mps;
        sample.traction_force_n = it.force_n > 0.0 ? it.force_n : 0.0;
        sample.brake_force_n = it.force_n < 0.0 ? -it.force_n : 0.0;
        sample.gradient_permille = 0.0;
        sample.valid = DYNOCAR_HAS_SPEED | DYNOCAR_HAS_TRACTION_FORCE | DYNOCAR_HAS_BRAKE_FORCE
                       | DYNOCAR_HAS_GRADIENT;
        /* A refused sample counts as lost; the cycle goes on. */
        (void)dynocar_publisher_publish(publisher, &sample);
        /* The simulated clock waits for the daemon, where there is one; a real one never does. */
        (void)dynocar_publisher_flush(publisher, PATIENCE_NS, NULL);
        (void)dynocar_reader_poll(reader, NULL);
        known = learned(reader);
        if (cycles % 150 == 149 && it.at_m < coast_from_m) {
            coast_from_m = coasting_place_m(&known);
        }
        step(&it, controller_n(&it, coast_from_m, &known), &TRUTH);
        cycles++;
    }
    known = learned(reader);
    printf("leg %d: %+.1f s off the timetable, %+.2f m off the stopping point, by %s (%.0f t)\n", leg,
           (double)cycles * CYCLE_S - DUE_S, it.at_m - LEG_M,
           known.is_learned ? "the daemon" : "the built-in parameters", 1e-3 * known.mass_kg);
    fflush(stdout);
}

int main(int count, char **arguments)
{
    uint64_t id = count > 1 ? strtoull(arguments[1], NULL, 10) : 1;
    int legs = count > 2 ? atoi(arguments[2]) : 6;
    dynocar_publisher *publisher = NULL;
    dynocar_reader *reader = NULL;
    char message[DYNOCAR_MESSAGE_BYTES];
    if (dynocar_publisher_open(NULL, id, &publisher, message, sizeof message) != DYNOCAR_OK
        || dynocar_reader_open(NULL, id, &reader, message, sizeof message) != DYNOCAR_OK) {
        fprintf(stderr, "%s\n", message);
        dynocar_publisher_close(publisher);
        return 1;
    }
    int64_t time_ns = dynocar_monotonic_now_ns();
    for (int leg = 1; leg <= legs; leg++) {
        drive(publisher, reader, leg, &time_ns);
    }
    dynocar_reader_close(reader);
    dynocar_publisher_close(publisher);
    return 0;
}
