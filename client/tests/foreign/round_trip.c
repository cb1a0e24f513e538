/* Drives a train through the C interface and prints what it sees; the test plays the daemon. */
#define _POSIX_C_SOURCE 200809L

#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

#include "dynocar.h"

#define PATIENCE_CYCLES 60000L

static void must(dynocar_code code, const char *what, const char *message)
{
    if (code != DYNOCAR_OK) {
        fprintf(stderr, "%s: %s; %s\n", what, dynocar_code_text(code), message);
        exit(1);
    }
}

static void pause_1_ms(void)
{
    struct timespec pause = {0, 1000000};
    nanosleep(&pause, NULL);
}

static void publish(dynocar_publisher *publisher, double cycle)
{
    dynocar_train_sample sample = dynocar_sample_empty();
    sample.time_ns = 1000 + (int64_t)cycle;
    sample.direction = -1;
    sample.flags = DYNOCAR_FLAG_WHEEL_SLIDE;
    sample.valid = DYNOCAR_HAS_POSITION | DYNOCAR_HAS_SPEED | DYNOCAR_HAS_TRACTION_FORCE
                   | DYNOCAR_HAS_BRAKE_FORCE | DYNOCAR_HAS_BRAKE_CYLINDER_PRESSURE
                   | DYNOCAR_HAS_ACCELERATION | DYNOCAR_HAS_SPECIFIC_FORCE | DYNOCAR_HAS_MASS
                   | DYNOCAR_HAS_AMBIENT_TEMPERATURE | DYNOCAR_HAS_GRADIENT
                   | DYNOCAR_HAS_CURVE_RADIUS;
    sample.position_m = cycle + 0.5;
    sample.speed_mps = cycle + 1.5;
    sample.traction_force_n = cycle + 2.5;
    sample.brake_force_n = cycle + 3.5;
    sample.brake_cylinder_pressure_pa = cycle + 4.5;
    sample.acceleration_mps2 = cycle + 5.5;
    sample.specific_force_mps2 = cycle + 6.5;
    sample.mass_kg = cycle + 7.5;
    sample.ambient_temperature_degc = cycle + 8.5;
    sample.gradient_permille = cycle + 9.5;
    sample.curve_radius_m = cycle + 10.5;
    must(dynocar_publisher_publish(publisher, &sample), "publish", "");
}

static void print_snapshot(const dynocar_reading *reading)
{
    const dynocar_parameter_snapshot *snapshot = &reading->snapshot;
    dynocar_resistance resistance;
    double value, std, covariance;
    printf("sample_sequence %" PRIu64 "\n", snapshot->sample_sequence);
    printf("status %s %s\n", dynocar_status_name(reading->status),
           dynocar_reason_name(reading->reason));
    printf("pipeline %" PRIu32 " %s\n", snapshot->pipeline_index,
           dynocar_pipeline_name(snapshot->pipeline_kind));
    must(dynocar_snapshot_resistance(snapshot, 20.0, 1e5, &resistance), "resistance", "");
    printf("resistance %.17g %.17g %.17g %.17g\n", resistance.w0_n_per_kn,
           resistance.w0_std_n_per_kn, resistance.force_n, resistance.force_std_n);
    printf("extrapolated %d\n", resistance.is_extrapolated != 0);
    must(dynocar_snapshot_value(snapshot, DYNOCAR_PARAMETER_DAVIS_B, &value, &std), "value", "");
    printf("davis_b %.17g %.17g\n", value, std);
    must(dynocar_snapshot_covariance(snapshot, DYNOCAR_PARAMETER_DAVIS_B,
                                     DYNOCAR_PARAMETER_DAVIS_C, &covariance),
         "covariance", "");
    printf("covariance %.17g\n", covariance);
    printf("wheel_slide %" PRIu32 "\n", snapshot->rejected_by_reason[DYNOCAR_REJECTED_WHEEL_SLIDE]);
    printf("manoeuvres %d\n", snapshot->missing_manoeuvres
                                  == (DYNOCAR_MANOEUVRE_COAST_SLOW | DYNOCAR_MANOEUVRE_ACCELERATE));
}

/* Publishes until an answer to the 20th sample or a later one is usable. */
static long drive(dynocar_publisher *publisher, dynocar_reader *reader)
{
    dynocar_reading reading, same, kind;
    for (long cycle = 0; cycle < PATIENCE_CYCLES; cycle++) {
        int64_t now_ns = dynocar_monotonic_now_ns();
        publish(publisher, (double)cycle);
        must(dynocar_reader_poll(reader, NULL), "poll", "");
        dynocar_code code = dynocar_reader_resistance(reader, now_ns, &reading);
        if (code == DYNOCAR_OK && reading.is_usable && reading.snapshot.sample_sequence >= 20) {
            must(dynocar_reader_latest_by_index(reader, 3, now_ns, &same), "by index", "");
            must(dynocar_reader_latest(reader, DYNOCAR_PIPELINE_RESISTANCE_KALMAN, now_ns, &kind),
                 "by kind", "");
            printf("same %d\n", same.snapshot.sequence == reading.snapshot.sequence
                                    && kind.snapshot.sequence == reading.snapshot.sequence);
            must(dynocar_reader_braking_ratio(reader, now_ns, &same), "braking ratio", "");
            printf("provided %" PRIu32 " %" PRId32 "\n", same.is_usable,
                   dynocar_reader_mass(reader, now_ns, &kind));
            print_snapshot(&reading);
            return cycle + 1;
        }
        pause_1_ms();
    }
    fprintf(stderr, "no answer\n");
    exit(3);
}

/* Polls until the daemon, which stops at a new run, counts as silent. */
static void wait_for_silence(dynocar_reader *reader)
{
    dynocar_reading reading;
    for (long cycle = 0; cycle < PATIENCE_CYCLES; cycle++) {
        must(dynocar_reader_poll(reader, NULL), "poll", "");
        must(dynocar_reader_latest(reader, DYNOCAR_PIPELINE_RESISTANCE_KALMAN,
                                   dynocar_monotonic_now_ns(), &reading),
             "latest", "");
        if (reading.is_stale) {
            printf("silent %s %s %" PRIu32 "\n", dynocar_status_name(reading.status),
                   dynocar_reason_name(reading.reason), reading.is_usable);
            return;
        }
        pause_1_ms();
    }
    fprintf(stderr, "never silent\n");
    exit(3);
}

int main(int count, char **arguments)
{
    if (count != 3) {
        return 2;
    }
    const char *root = arguments[1];
    uint64_t train = strtoull(arguments[2], NULL, 10);
    dynocar_publisher *publisher = NULL, *second = NULL;
    dynocar_reader *reader = NULL;
    char message[DYNOCAR_MESSAGE_BYTES];
    int32_t state = -1;
    uint64_t refused = 99, untaken = 99;

    printf("matches %d\n", dynocar_header_matches_library());
    must(dynocar_daemon_state(root, train, &state, message, sizeof message), "daemon", message);
    printf("daemon %" PRId32 "\n", state);
    must(dynocar_publisher_open(root, train, &publisher, message, sizeof message), "open", message);
    must(dynocar_reader_open(root, train, &reader, message, sizeof message), "open", message);
    must(dynocar_reader_set_stale_after_ns(reader, 100000000), "stale", "");
    printf("second %" PRId32 "\n",
           dynocar_publisher_open(root, train, &second, message, sizeof message));

    long cycle = drive(publisher, reader);
    must(dynocar_publisher_start_run(publisher), "start run", "");
    publish(publisher, (double)cycle);
    wait_for_silence(reader);
    must(dynocar_reader_refused(reader, &refused), "refused", "");
    printf("refused %" PRIu64 "\n", refused);
    must(dynocar_publisher_flush(publisher, 60000000000, &untaken), "flush", "");
    printf("untaken %" PRIu64 "\n", untaken);
    must(dynocar_reader_close(reader), "close", "");
    must(dynocar_publisher_close(publisher), "close", "");
    return 0;
}
