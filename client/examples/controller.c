/* A controller's cycle at 1 kHz: publish a sample, poll, use what the daemon learned, and fall back
 * to the built-in parameters whenever that is not usable.
 *
 * controller [train id] [seconds]
 * reports on standard output whenever its resistance comes from another source. Ten seconds of coasting
 * teach the daemon next to nothing: let "dynocar replay config/demo --rate 200" drive train 1 first,
 * and this one drives on with what was learned.
 * README.md beside this folder says how to build it. */
#define _POSIX_C_SOURCE 200809L

#include <stdio.h>
#include <stdlib.h>
#include <time.h>

#include "dynocar.h"

#define CYCLE_NS 1000000L
/* The train of config/demo/train.toml, which config/daemon.toml serves as train 1. */
#define MASS_KG 1799200.0
#define ROTATING_MASS_FACTOR 0.04

/* Davis a, b, c in N/kN and m/s, as the manufacturer declared them. */
static double built_in_force_n(double speed_mps)
{
    return (1.498 + speed_mps * (0.0147 + speed_mps * 0.00086)) * MASS_KG * 9.81 / 1000.0;
}

/* Where a resistance comes from, and why. */
typedef struct {
    const char *name;
    const char *reason;
} origin;

static double resistance_n(dynocar_reader *reader, double speed_mps, origin *from)
{
    dynocar_reading reading;
    dynocar_resistance resistance;
    dynocar_code code = dynocar_reader_resistance(reader, dynocar_monotonic_now_ns(), &reading);
    if (reading.is_usable
        && dynocar_snapshot_resistance(&reading.snapshot, speed_mps, MASS_KG, &resistance)
               == DYNOCAR_OK) {
        from->name = "the daemon";
        from->reason = dynocar_use_state_name(dynocar_reading_use_state(&reading));
        return resistance.force_n;
    }
    from->name = "the built-in parameters";
    from->reason = code == DYNOCAR_OK                   ? dynocar_reading_why(&reading)
                   : code == DYNOCAR_ERROR_NOT_PROVIDED ? "not_provided"
                                                        : "no_snapshot";
    return built_in_force_n(speed_mps);
}

static void wait_until(struct timespec *next)
{
    next->tv_nsec += CYCLE_NS;
    if (next->tv_nsec >= 1000000000L) {
        next->tv_nsec -= 1000000000L;
        next->tv_sec += 1;
    }
    clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, next, NULL);
}

static void drive(dynocar_publisher *publisher, dynocar_reader *reader, long cycles)
{
    double speed_mps = 20.0;
    origin before = {"", ""};
    struct timespec next;
    clock_gettime(CLOCK_MONOTONIC, &next);
    for (long cycle = 0; cycle < cycles; cycle++) {
        dynocar_train_sample sample = dynocar_sample_empty();
        sample.time_ns = dynocar_monotonic_now_ns();
        sample.speed_mps = speed_mps;
        sample.traction_force_n = 0.0;
        sample.brake_force_n = 0.0;
        /* This train knows its gradient; one that knows its position sends that instead. */
        sample.gradient_permille = 0.0;
        sample.valid = DYNOCAR_HAS_SPEED | DYNOCAR_HAS_TRACTION_FORCE | DYNOCAR_HAS_BRAKE_FORCE
                       | DYNOCAR_HAS_GRADIENT;
        /* A refused sample counts as lost; the cycle goes on. */
        (void)dynocar_publisher_publish(publisher, &sample);

        (void)dynocar_reader_poll(reader, NULL);
        origin from;
        double force_n = resistance_n(reader, speed_mps, &from);
        if (strcmp(from.reason, before.reason) != 0) {
            /* A real controller would not print from its cycle. */
            printf("cycle %ld: %.0f N at %.2f m/s from %s (%s)\n", cycle, force_n, speed_mps,
                   from.name, from.reason);
            fflush(stdout);
            before = from;
        }

        /* In place of the train: it coasts on the level. */
        speed_mps -= built_in_force_n(speed_mps) / (MASS_KG * (1.0 + ROTATING_MASS_FACTOR))
                     * (CYCLE_NS * 1e-9);
        wait_until(&next);
    }
    printf("published %ld samples\n", cycles);
}

int main(int count, char **arguments)
{
    uint64_t train = count > 1 ? strtoull(arguments[1], NULL, 10) : 1;
    long seconds = count > 2 ? strtol(arguments[2], NULL, 10) : 10;
    dynocar_publisher *publisher = NULL;
    dynocar_reader *reader = NULL;
    char message[DYNOCAR_MESSAGE_BYTES];

    if (!dynocar_header_matches_library()) {
        fprintf(stderr, "dynocar.h does not belong to library %s\n", dynocar_version());
        return 1;
    }
    if (dynocar_publisher_open(NULL, train, &publisher, message, sizeof message) != DYNOCAR_OK
        || dynocar_reader_open(NULL, train, &reader, message, sizeof message) != DYNOCAR_OK) {
        fprintf(stderr, "%s\n", message);
        dynocar_publisher_close(publisher);
        return 1;
    }
    drive(publisher, reader, seconds * 1000);
    dynocar_reader_close(reader);
    dynocar_publisher_close(publisher);
    return 0;
}
