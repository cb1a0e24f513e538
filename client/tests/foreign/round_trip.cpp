/* round_trip.c by the wrapper for C++: the same lines, and what only the wrapper promises. */
#include <cinttypes>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <new>
#include <type_traits>

#include <time.h>

#include "dynocar.hpp"

static_assert(!std::is_copy_constructible_v<dynocar::Publisher>);
static_assert(!std::is_copy_constructible_v<dynocar::Reader>);
static_assert(std::is_nothrow_move_constructible_v<dynocar::Publisher>);
static_assert(std::is_nothrow_move_constructible_v<dynocar::Reader>);

static constexpr long PATIENCE_CYCLES = 60000;
static unsigned long allocations = 0;

void *operator new(std::size_t size)
{
    allocations += 1;
    void *memory = std::malloc(size == 0 ? 1 : size);
    if (memory == nullptr) {
        std::abort();
    }
    return memory;
}

void operator delete(void *memory) noexcept { std::free(memory); }
void operator delete(void *memory, std::size_t) noexcept { std::free(memory); }

static void must(dynocar_code code, const char *what)
{
    if (code != DYNOCAR_OK) {
        std::fprintf(stderr, "%s: %s\n", what, dynocar_code_text(code));
        std::exit(1);
    }
}

template <typename Found> static Found must_be(std::optional<Found> found, const char *what)
{
    if (!found) {
        std::fprintf(stderr, "%s: nothing\n", what);
        std::exit(1);
    }
    return *found;
}

template <typename End> static End must_open(dynocar::Opened<End> opened)
{
    if (!opened) {
        std::fprintf(stderr, "open: %s\n", opened.error().c_str());
        std::exit(1);
    }
    return std::move(*opened);
}

static void pause_1_ms()
{
    const timespec pause = {0, 1000000};
    nanosleep(&pause, nullptr);
}

static void publish(dynocar::Publisher &publisher, double cycle)
{
    dynocar::Sample sample(1000 + static_cast<std::int64_t>(cycle));
    sample.is_chainage_growing(false).is_wheel_slide_active(true);
    sample.position_m(cycle + 0.5).speed_mps(cycle + 1.5).traction_force_n(cycle + 2.5);
    sample.brake_force_n(cycle + 3.5).brake_cylinder_pressure_pa(cycle + 4.5);
    sample.acceleration_mps2(cycle + 5.5).specific_force_mps2(cycle + 6.5).mass_kg(cycle + 7.5);
    sample.ambient_temperature_degc(cycle + 8.5).gradient_permille(cycle + 9.5);
    sample.curve_radius_m(cycle + 10.5);
    must(publisher.publish(sample), "publish");
}

static void print_reading(const dynocar::Reading &reading)
{
    const dynocar_parameter_snapshot &snapshot = reading.raw().snapshot;
    std::printf("sample_sequence %" PRIu64 "\n", snapshot.sample_sequence);
    std::printf("status %s %s\n", reading.status_name(), reading.why());
    std::printf("pipeline %" PRIu32 " %s\n", snapshot.pipeline_index,
                dynocar_pipeline_name(snapshot.pipeline_kind));
    const auto resistance = must_be(reading.resistance_at(20.0, 1e5), "resistance");
    std::printf("resistance %.17g %.17g %.17g %.17g\n", resistance.w0_n_per_kn,
                resistance.w0_std_n_per_kn, resistance.force_n, resistance.force_std_n);
    std::printf("extrapolated %d\n", resistance.is_extrapolated != 0);
    const auto davis_b = must_be(reading.value(DYNOCAR_PARAMETER_DAVIS_B), "value");
    std::printf("davis_b %.17g %.17g\n", davis_b.value, davis_b.std);
    const auto mass_t = must_be(reading.mass_t(), "mass");
    std::printf("mass_t %.17g %.17g %.17g\n", mass_t.value, mass_t.lower_95(), mass_t.upper_95());
    const bool has_others = reading.adhesion() || reading.adhesion_lower_bound()
                            || reading.disc_friction() || reading.braking_ratio();
    std::printf("others %d\n", has_others);
    double covariance = 0.0;
    must(dynocar_snapshot_covariance(&snapshot, DYNOCAR_PARAMETER_DAVIS_B,
                                     DYNOCAR_PARAMETER_DAVIS_C, &covariance),
         "covariance");
    std::printf("covariance %.17g\n", covariance);
    std::printf("wheel_slide %" PRIu32 "\n",
                snapshot.rejected_by_reason[DYNOCAR_REJECTED_WHEEL_SLIDE]);
    std::printf("manoeuvres %d\n", snapshot.missing_manoeuvres
                                       == (DYNOCAR_MANOEUVRE_COAST_SLOW
                                           | DYNOCAR_MANOEUVRE_ACCELERATE));
}

/* Publishes until an answer to the 20th sample or a later one is usable. */
static long drive(dynocar::Publisher &publisher, dynocar::Reader &reader)
{
    for (long cycle = 0; cycle < PATIENCE_CYCLES; cycle++) {
        const std::int64_t now_ns = dynocar_monotonic_now_ns();
        publish(publisher, static_cast<double>(cycle));
        must(reader.poll(), "poll");
        const auto reading = reader.resistance(now_ns);
        const std::uint64_t sequence = reading.raw().snapshot.sequence;
        if (reading && reading.raw().snapshot.sample_sequence >= 20) {
            const auto kind = reader.latest(DYNOCAR_PIPELINE_RESISTANCE_KALMAN, now_ns);
            const auto same = reader.latest_by_index(3, now_ns);
            std::printf("same %d\n", same.raw().snapshot.sequence == sequence
                                         && kind.raw().snapshot.sequence == sequence);
            const auto mass = reader.mass(now_ns);
            std::printf("provided %d %" PRId32 "\n", reader.braking_ratio(now_ns).is_usable(),
                        mass.code());
            const bool is_known = reader.adhesion(now_ns) || reader.brake_friction(now_ns);
            std::printf("absent %s %d %d\n", mass.why(), mass.mass_t().has_value(), is_known);
            print_reading(reading);
            return cycle + 1;
        }
        pause_1_ms();
    }
    std::fprintf(stderr, "no answer\n");
    std::exit(3);
}

/* Polls until the daemon, which stops at a new run, counts as silent. */
static void wait_for_silence(dynocar::Reader &reader)
{
    for (long cycle = 0; cycle < PATIENCE_CYCLES; cycle++) {
        must(reader.poll(), "poll");
        const auto reading = reader.resistance();
        if (reading.raw().is_stale != 0) {
            std::printf("silent %s %s %d\n", reading.status_name(), reading.why(),
                        reading.is_usable());
            std::printf("held_back %d\n", reading.resistance_at(20.0).has_value()
                                              || reading.mass_t().has_value());
            return;
        }
        pause_1_ms();
    }
    std::fprintf(stderr, "never silent\n");
    std::exit(3);
}

int main(int count, char **arguments)
{
    if (count != 3) {
        return 2;
    }
    const char *root = arguments[1];
    const std::uint64_t train = std::strtoull(arguments[2], nullptr, 10);

    std::printf("matches %d\n", dynocar_header_matches_library());
    std::printf("daemon %" PRId32 "\n", dynocar::daemon_state(train, root).state);
    auto publisher = must_open(dynocar::Publisher::open(train, root));
    auto reader = must_open(dynocar::Reader::open(train, root));
    must(reader.set_stale_after(std::chrono::milliseconds(100)), "stale");
    const auto second = dynocar::Publisher::open(train, root);
    std::printf("second %" PRId32 "\n", second.code());
    std::printf("words %s\n", second.error().c_str());

    const auto unset = dynocar::Sample().speed_mps(20.0).speed_mps(std::nan("")).mass_kg(1e5);
    std::printf("valid %d\n", unset.raw().valid == DYNOCAR_HAS_MASS);

    const unsigned long before = allocations;
    long cycle = drive(publisher, reader);
    must(publisher.start_run(), "start run");
    publish(publisher, static_cast<double>(cycle));
    wait_for_silence(reader);
    std::printf("allocated %lu\n", allocations - before);
    std::printf("refused %" PRIu64 "\n", must_be(reader.refused(), "refused"));
    std::printf("untaken %" PRIu64 "\n", must_be(publisher.flush(std::chrono::minutes(1)), "flush"));

    dynocar::Publisher driver = std::move(publisher);
    must(driver.start_run(), "the moved one");
    std::printf("moved %" PRId32 "\n", publisher.start_run());
    return 0;
}
