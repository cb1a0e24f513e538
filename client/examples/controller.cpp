/* A controller's cycle at 1 kHz in C++17: publish a sample, poll, use what the daemon learned, and
 * fall back to the built-in parameters whenever that is not usable.
 *
 * controller [train id] [seconds]
 * prints whenever its resistance comes from another source. Ten seconds of coasting teach the daemon
 * next to nothing: let "dynocar replay config/demo --rate 200" drive train 1 first, and this one
 * drives on with what was learned.
 * README.md beside this folder says how to build it. */
#include <chrono>
#include <cstdint>
#include <iostream>
#include <string>
#include <string_view>
#include <thread>

#include "dynocar.hpp"

namespace {

constexpr std::chrono::milliseconds CYCLE(1);
/* The train of config/demo/train.toml, which config/daemon.toml serves as train 1. */
constexpr double MASS_KG = 1'799'200.0;
constexpr double ROTATING_MASS_FACTOR = 0.04;

/* Davis a, b, c in N/kN and m/s, as the manufacturer declared them. */
double built_in_force_n(double speed_mps)
{
    return (1.498 + speed_mps * (0.0147 + speed_mps * 0.00086)) * MASS_KG * 9.81 / 1000.0;
}

/* A resistance, where it comes from, and why. */
struct Resistance {
    double force_n;
    std::string_view source;
    std::string_view why;
};

Resistance resistance(dynocar::Reader &reader, double speed_mps)
{
    const auto reading = reader.resistance();
    if (const auto found = reading.resistance_at(speed_mps, MASS_KG)) {
        return {found->force_n, "the daemon", reading.use_state_name()};
    }
    return {built_in_force_n(speed_mps), "the built-in parameters", reading.why()};
}

void drive(dynocar::Publisher &publisher, dynocar::Reader &reader, long cycles)
{
    double speed_mps = 20.0;
    std::string_view before;
    auto next = std::chrono::steady_clock::now();
    for (long cycle = 0; cycle < cycles; cycle++) {
        dynocar::Sample sample;
        sample.speed_mps(speed_mps).traction_force_n(0.0).brake_force_n(0.0);
        /* This train knows its gradient; one that knows its position sends that instead. */
        sample.gradient_permille(0.0);
        /* A refused sample counts as lost; the cycle goes on. */
        (void)publisher.publish(sample);

        (void)reader.poll();
        const Resistance found = resistance(reader, speed_mps);
        if (found.why != before) {
            /* A real controller would not print from its cycle. */
            std::cout << "cycle " << cycle << ": " << found.force_n << " N at " << speed_mps
                      << " m/s from " << found.source << " (" << found.why << ")" << std::endl;
            before = found.why;
        }

        /* In place of the train: it coasts on the level. */
        speed_mps -= built_in_force_n(speed_mps) / (MASS_KG * (1.0 + ROTATING_MASS_FACTOR))
                     * std::chrono::duration<double>(CYCLE).count();
        next += CYCLE;
        std::this_thread::sleep_until(next);
    }
    std::cout << "published " << cycles << " samples" << std::endl;
}

} // namespace

int main(int count, char **arguments)
{
    const std::uint64_t train = count > 1 ? std::stoull(arguments[1]) : 1;
    const long seconds = count > 2 ? std::stol(arguments[2]) : 10;

    auto publisher = dynocar::Publisher::open(train);
    auto reader = dynocar::Reader::open(train);
    if (!publisher || !reader) {
        std::cerr << (publisher ? reader.error() : publisher.error()) << std::endl;
        return 1;
    }
    drive(*publisher, *reader, seconds * 1000);
    return 0;
}
