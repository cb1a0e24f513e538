/* Braking distance from the present speed, under what the daemon has learned of the rail, of the
 * brake and of the resistance; with the built-in values where it has learned nothing usable.
 *
 * stopping [train id] [speed in m/s]
 * README.md beside this folder says how to build it. */
#define _POSIX_C_SOURCE 200809L

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "dynocar.h"

/* The train of config/demo/train.toml, which config/daemon.toml serves as train 1. */
#define MASS_KG 1799200.0
#define DECLARED_FRICTION 0.35
#define CONFIDENCE 0.99

static const dynocar_effort_point EFFORT[] = {{0.0, 1216000.0}, {30.0, 1216000.0}};

static const uint32_t ASKED[] = {DYNOCAR_QUANTITY_RESISTANCE, DYNOCAR_QUANTITY_BRAKE_FRICTION,
                                 DYNOCAR_QUANTITY_ADHESION};

/* 1 when the daemon's answer may be used; reports where the value comes from. */
static int learned(dynocar_reader *reader, uint32_t quantity, dynocar_reading *reading)
{
    dynocar_code code =
        dynocar_reader_quantity(reader, quantity, dynocar_monotonic_now_ns(), reading);
    const char *why = code == DYNOCAR_ERROR_NOT_PROVIDED ? "not_provided" : "no_snapshot";
    if (code == DYNOCAR_OK) {
        why = reading->is_usable ? dynocar_use_state_name(DYNOCAR_USE_USABLE)
                                 : dynocar_reading_why(reading);
    }
    printf("%s: the %s (%s)\n", dynocar_quantity_name(quantity),
           reading->is_usable ? "daemon" : "built-in values", why);
    return reading->is_usable != 0;
}

/* Polls for up to half a second, until every pipeline that answers has been heard. */
static void listen_to(dynocar_reader *reader)
{
    const struct timespec pause = {0, 10000000};
    size_t heard = 0;
    for (int round = 0; round < 50 && heard < sizeof ASKED / sizeof *ASKED; round++) {
        (void)dynocar_reader_poll(reader, NULL);
        for (heard = 0; heard < sizeof ASKED / sizeof *ASKED; heard++) {
            dynocar_reading reading;
            if (dynocar_reader_quantity(reader, ASKED[heard], dynocar_monotonic_now_ns(), &reading)
                == DYNOCAR_ERROR_NO_SNAPSHOT) {
                nanosleep(&pause, NULL);
                break;
            }
        }
    }
}

/* The law behind DYNOCAR_RAIL_WET_LAW. */
static double wet_adhesion(double speed_mps)
{
    return 0.04 + 13.7 / (120.0 + 3.6 * speed_mps);
}

static dynocar_stop built_in_stop(double speed_mps)
{
    dynocar_stop stop;
    memset(&stop, 0, sizeof stop);
    stop.from_speed_mps = speed_mps;
    stop.mass_kg = MASS_KG;
    stop.rotating_mass_factor = 0.04;
    stop.davis_a = 1.498;
    stop.davis_b = 0.0147;
    stop.davis_c = 0.00086;
    stop.w0_std_n_per_kn = 0.3;
    stop.brake_scale = 1.0;
    stop.brake_scale_std = 0.1;
    /* Declared, or law.response of `dynocar stops --json`. */
    stop.dead_time_s = 0.8;
    stop.build_up_s = 2.0;
    stop.response_std_s = 0.3;
    /* A wet rail, until the daemon knows better. */
    stop.rail = DYNOCAR_RAIL_WET_LAW;
    stop.adhesion = 1.0;
    stop.adhesion_std = 0.1;
    return stop;
}

static void take_what_is_learned(dynocar_reader *reader, dynocar_stop *stop)
{
    dynocar_reading reading;
    const dynocar_parameter_snapshot *snapshot = &reading.snapshot;
    dynocar_resistance resistance;
    double value, std;
    if (learned(reader, DYNOCAR_QUANTITY_RESISTANCE, &reading)
        && dynocar_snapshot_resistance(snapshot, stop->from_speed_mps, 0.0, &resistance)
               == DYNOCAR_OK) {
        dynocar_snapshot_value(snapshot, DYNOCAR_PARAMETER_DAVIS_A, &stop->davis_a, NULL);
        dynocar_snapshot_value(snapshot, DYNOCAR_PARAMETER_DAVIS_B, &stop->davis_b, NULL);
        dynocar_snapshot_value(snapshot, DYNOCAR_PARAMETER_DAVIS_C, &stop->davis_c, NULL);
        stop->w0_std_n_per_kn = resistance.w0_std_n_per_kn;
    }
    if (learned(reader, DYNOCAR_QUANTITY_BRAKE_FRICTION, &reading)
        && dynocar_snapshot_value(snapshot, DYNOCAR_PARAMETER_DISC_FRICTION, &value, &std)
               == DYNOCAR_OK) {
        stop->brake_scale = value / DECLARED_FRICTION;
        stop->brake_scale_std = std / DECLARED_FRICTION;
    }
    if (learned(reader, DYNOCAR_QUANTITY_ADHESION, &reading)
        && dynocar_snapshot_value(snapshot, DYNOCAR_PARAMETER_ADHESION, &value, &std)
               == DYNOCAR_OK) {
        /* The rail carries less at this speed than where the last braking ended: along the wet law. */
        double there = wet_adhesion(snapshot->speed_min_mps);
        stop->rail = DYNOCAR_RAIL_WET_LAW;
        stop->adhesion = value / there;
        stop->adhesion_std = std / there;
    }
}

int main(int count, char **arguments)
{
    uint64_t train = count > 1 ? strtoull(arguments[1], NULL, 10) : 1;
    double speed_mps = count > 2 ? strtod(arguments[2], NULL) : 20.0;
    dynocar_reader *reader = NULL;
    char message[DYNOCAR_MESSAGE_BYTES];
    if (dynocar_reader_open(NULL, train, &reader, message, sizeof message) != DYNOCAR_OK) {
        fprintf(stderr, "%s\n", message);
        return 1;
    }
    listen_to(reader);
    dynocar_stop stop = built_in_stop(speed_mps);
    take_what_is_learned(reader, &stop);
    dynocar_stopping found;
    dynocar_code code = dynocar_stopping_estimate(&stop, EFFORT, sizeof EFFORT / sizeof *EFFORT,
                                                  CONFIDENCE, &found);
    if (code == DYNOCAR_OK) {
        printf("from %.1f m/s: %.0f m and %.1f s; with %.0f %% confidence within %.0f m and %.1f s\n",
               speed_mps, found.distance_m, found.time_s, 100.0 * CONFIDENCE,
               found.distance_bound_m, found.time_bound_s);
    } else {
        printf("%s\n", dynocar_code_text(code));
    }
    dynocar_reader_close(reader);
    return code == DYNOCAR_OK ? 0 : 1;
}
