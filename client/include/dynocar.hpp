/*
 * Dynocar's client library for C++17 and later: dynocar.h, whose handles close themselves and whose
 * readings give a value only while it may be used.
 *
 *     auto publisher = dynocar::Publisher::open(train_id);
 *     auto reader = dynocar::Reader::open(train_id);
 *     if (!publisher || !reader) { ... publisher.error(), reader.error() ... }
 *
 *     publisher->publish(dynocar::Sample().speed_mps(21.5).traction_force_n(0.0));
 *     reader->poll();
 *     if (auto resistance = reader->resistance().resistance_at(21.5, mass_kg)) {
 *         ... resistance->force_n ...
 *     } else { ... the controller's own parameters ... }
 *
 * No call of a cycle throws, and all of it builds without exceptions and without run-time types;
 * where memory is short, opening throws std::bad_alloc. The calls of a cycle do no more than the
 * calls of dynocar.h behind them, by the same rules: see there which are REAL-TIME, and that a handle
 * belongs to the thread that opened it. The numbers of vocabularies (DYNOCAR_PARAMETER_...) and the
 * structs are those of dynocar.h, and so are the functions for braking distances, which need no
 * handle.
 */
#ifndef DYNOCAR_HPP
#define DYNOCAR_HPP

#include <chrono>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <utility>

#include "dynocar.h"

namespace dynocar {

/* What opening gave: an end of a channel, or why there is none. */
template <typename End> class [[nodiscard]] Opened {
  public:
    explicit Opened(End end) : end_(std::move(end)) {}
    Opened(dynocar_code code, std::string error)
        : end_(std::nullopt), code_(code), error_(std::move(error)) {}

    /* True when it was opened; only then may * and -> be used. */
    explicit operator bool() const noexcept { return end_.has_value(); }
    End &operator*() noexcept { return *end_; }
    End *operator->() noexcept { return &*end_; }

    /* DYNOCAR_OK, or DYNOCAR_ERROR_... */
    dynocar_code code() const noexcept { return code_; }
    /* Why it was not opened, in words; empty when it was. */
    const std::string &error() const noexcept { return error_; }

  private:
    std::optional<End> end_;
    dynocar_code code_ = DYNOCAR_OK;
    std::string error_ = {};
};

/* One cycle of a train. A quantity that is not set is missing, and so is one that is NaN. */
class Sample {
  public:
    /* Measured now, by dynocar_monotonic_now_ns(). */
    Sample() noexcept : Sample(dynocar_monotonic_now_ns()) {}
    /* Measured at a time on the controller's monotonic clock. */
    explicit Sample(std::int64_t time_ns) noexcept : raw_(dynocar_sample_empty())
    {
        raw_.time_ns = time_ns;
    }

    /* Chainage of the train's centre. */
    Sample &position_m(double value) noexcept
    {
        return set(raw_.position_m, DYNOCAR_HAS_POSITION, value);
    }
    /* Never negative. */
    Sample &speed_mps(double value) noexcept
    {
        return set(raw_.speed_mps, DYNOCAR_HAS_SPEED, value);
    }
    /* Of the whole train at the wheel rims, never negative. */
    Sample &traction_force_n(double value) noexcept
    {
        return set(raw_.traction_force_n, DYNOCAR_HAS_TRACTION_FORCE, value);
    }
    /* The same, retarding. */
    Sample &brake_force_n(double value) noexcept
    {
        return set(raw_.brake_force_n, DYNOCAR_HAS_BRAKE_FORCE, value);
    }
    Sample &brake_cylinder_pressure_pa(double value) noexcept
    {
        return set(raw_.brake_cylinder_pressure_pa, DYNOCAR_HAS_BRAKE_CYLINDER_PRESSURE, value);
    }
    /* dv/dt, as measured. */
    Sample &acceleration_mps2(double value) noexcept
    {
        return set(raw_.acceleration_mps2, DYNOCAR_HAS_ACCELERATION, value);
    }
    /* What an accelerometer reads along the track: dv/dt + g * gradient. */
    Sample &specific_force_mps2(double value) noexcept
    {
        return set(raw_.specific_force_mps2, DYNOCAR_HAS_SPECIFIC_FORCE, value);
    }
    /* Gross, without the rotating part. */
    Sample &mass_kg(double value) noexcept { return set(raw_.mass_kg, DYNOCAR_HAS_MASS, value); }
    Sample &ambient_temperature_degc(double value) noexcept
    {
        return set(raw_.ambient_temperature_degc, DYNOCAR_HAS_AMBIENT_TEMPERATURE, value);
    }
    /* Climbing positive as the chainage grows; for lines without a track file. */
    Sample &gradient_permille(double value) noexcept
    {
        return set(raw_.gradient_permille, DYNOCAR_HAS_GRADIENT, value);
    }
    /* 0 on straight track; for lines without a track file. */
    Sample &curve_radius_m(double value) noexcept
    {
        return set(raw_.curve_radius_m, DYNOCAR_HAS_CURVE_RADIUS, value);
    }
    /* True (at first) while the chainage grows in the direction of travel. */
    Sample &is_chainage_growing(bool is_growing) noexcept
    {
        raw_.direction = is_growing ? std::int8_t{1} : std::int8_t{-1};
        return *this;
    }
    /* True while the wheel-slide protection is active; false at first. */
    Sample &is_wheel_slide_active(bool is_active) noexcept
    {
        raw_.flags = is_active ? std::uint8_t{DYNOCAR_FLAG_WHEEL_SLIDE} : std::uint8_t{0};
        return *this;
    }

    /* The struct of dynocar.h. */
    const dynocar_train_sample &raw() const noexcept { return raw_; }

  private:
    Sample &set(double &field, unsigned bit, double value) noexcept
    {
        const bool is_known = !std::isnan(value);
        field = is_known ? value : 0.0;
        raw_.valid = static_cast<std::uint16_t>(is_known ? raw_.valid | bit : raw_.valid & ~bit);
        return *this;
    }

    dynocar_train_sample raw_;
};

/* A number with its standard deviation, both in the unit of the call that gave it. */
struct Estimate {
    double value;
    double std;

    /* The ends of the 95 % interval. */
    double lower_95() const noexcept { return value - 1.96 * std; }
    double upper_95() const noexcept { return value + 1.96 * std; }
};

/* A pipeline's knowledge at the moment of the call, copied out. No handle: any thread may read it.
 * The calls that give a number give none unless it may be used; raw() shows it all the same. */
class Reading {
  public:
    Reading(dynocar_code code, const dynocar_reading &raw) noexcept : code_(code), raw_(raw) {}

    /* True while the values may be used, independent of the status of the estimate as a whole. */
    bool is_usable() const noexcept { return code_ == DYNOCAR_OK && raw_.is_usable != 0; }
    explicit operator bool() const noexcept { return is_usable(); }
    /* The state of use: DYNOCAR_USE_..., and its name. */
    std::uint32_t use_state() const noexcept
    {
        return code_ == DYNOCAR_OK ? dynocar_reading_use_state(&raw_)
                                   : std::uint32_t{DYNOCAR_USE_UNAVAILABLE};
    }
    const char *use_state_name() const noexcept { return dynocar_use_state_name(use_state()); }
    /* The reason for it, in one word: the reason behind the status ("none" only for usable values),
     * "confirming" for values that are known but held back, or "no_snapshot" or "not_provided". For
     * people to read. */
    const char *why() const noexcept
    {
        switch (code_) {
        case DYNOCAR_OK:
            return dynocar_reading_why(&raw_);
        case DYNOCAR_ERROR_NO_SNAPSHOT:
            return "no_snapshot";
        case DYNOCAR_ERROR_NOT_PROVIDED:
            return "not_provided";
        default:
            return dynocar_code_text(code_);
        }
    }
    const char *status_name() const noexcept { return dynocar_status_name(raw_.status); }
    /* Since the daemon last vouched for the values; the greatest there is where it never did. */
    std::chrono::nanoseconds age() const noexcept
    {
        return code_ == DYNOCAR_OK ? std::chrono::nanoseconds(raw_.age_ns)
                                   : std::chrono::nanoseconds::max();
    }

    /* Basic resistance at a speed: w0 in N/kN, and the force in N for a train of mass_kg. */
    std::optional<dynocar_resistance> resistance_at(double speed_mps,
                                                    double mass_kg = 0.0) const noexcept
    {
        dynocar_resistance found;
        if (!is_usable()
            || dynocar_snapshot_resistance(&raw_.snapshot, speed_mps, mass_kg, &found)
                   != DYNOCAR_OK) {
            return std::nullopt;
        }
        return found;
    }
    /* Gross mass in t, without the rotating part. */
    std::optional<Estimate> mass_t() const noexcept { return value(DYNOCAR_PARAMETER_MASS); }
    /* Adhesion of wheel on rail, where the rail was the limit. */
    std::optional<Estimate> adhesion() const noexcept { return value(DYNOCAR_PARAMETER_ADHESION); }
    /* What the rail carried at least, where the brake was the limit. */
    std::optional<Estimate> adhesion_lower_bound() const noexcept
    {
        return value(DYNOCAR_PARAMETER_ADHESION_LOWER_BOUND);
    }
    /* Friction of the brake discs, the declared braking ratio held. */
    std::optional<Estimate> disc_friction() const noexcept
    {
        return value(DYNOCAR_PARAMETER_DISC_FRICTION);
    }
    /* Braking ratio, the declared friction held. */
    std::optional<Estimate> braking_ratio() const noexcept
    {
        return value(DYNOCAR_PARAMETER_BRAKING_RATIO);
    }
    /* A parameter (DYNOCAR_PARAMETER_...) in its unit. */
    std::optional<Estimate> value(std::uint32_t parameter) const noexcept
    {
        Estimate found{};
        if (!is_usable()
            || dynocar_snapshot_value(&raw_.snapshot, parameter, &found.value, &found.std)
                   != DYNOCAR_OK) {
            return std::nullopt;
        }
        return found;
    }

    /* DYNOCAR_OK, or why there is no snapshot: DYNOCAR_ERROR_... */
    dynocar_code code() const noexcept { return code_; }
    /* The struct of dynocar.h, to look at: not to drive by unless is_usable(). */
    const dynocar_reading &raw() const noexcept { return raw_; }

  private:
    dynocar_code code_;
    dynocar_reading raw_;
};

namespace detail {

struct Close {
    void operator()(dynocar_publisher *end) const noexcept { (void)dynocar_publisher_close(end); }
    void operator()(dynocar_reader *end) const noexcept { (void)dynocar_reader_close(end); }
};

/* Opens an end by the call of dynocar.h for it. */
struct Opening {
    template <typename End, typename Handle>
    static Opened<End> open(dynocar_code (*call)(const char *, std::uint64_t, Handle **, char *,
                                                 std::size_t),
                            std::uint64_t train_id, const char *root)
    {
        if (dynocar_header_matches_library() == 0) {
            return Opened<End>(DYNOCAR_ERROR_INCOMPATIBLE_DAEMON,
                               std::string("dynocar.h does not belong to library ")
                                   + dynocar_version());
        }
        Handle *handle = nullptr;
        char message[DYNOCAR_MESSAGE_BYTES] = "";
        const dynocar_code code = call(root, train_id, &handle, message, sizeof message);
        return code == DYNOCAR_OK ? Opened<End>(End(handle)) : Opened<End>(code, message);
    }
};

} // namespace detail

/* The end that publishes a train's samples; closes itself, which waits up to 0.2 s. Can be moved,
 * not copied; one that was moved away gives DYNOCAR_ERROR_NULL_ARGUMENT. */
class Publisher {
  public:
    /* As dynocar_publisher_open(). root: nullptr: the variable DYNOCAR_ROOT, else
     * /tmp/dynocar-<user id>. */
    static Opened<Publisher> open(std::uint64_t train_id, const char *root = nullptr)
    {
        return detail::Opening::open<Publisher>(dynocar_publisher_open, train_id, root);
    }

    /* As dynocar_publisher_publish(). DYNOCAR_ERROR_SEND_REFUSED: it counts as lost; just go on. */
    dynocar_code publish(const Sample &sample) noexcept
    {
        dynocar_train_sample raw = sample.raw();
        return dynocar_publisher_publish(handle_.get(), &raw);
    }
    /* Starts a new run (trip): filters do not integrate across. */
    dynocar_code start_run() noexcept { return dynocar_publisher_start_run(handle_.get()); }
    /* Waits until every pipeline has taken every sample; gives how many the slowest has not taken,
     * or nothing when that is not known. Not for the control cycle. */
    std::optional<std::uint64_t> flush(std::chrono::nanoseconds patience) noexcept
    {
        std::uint64_t not_taken = 0;
        const auto code =
            dynocar_publisher_flush(handle_.get(), std::int64_t{patience.count()}, &not_taken);
        return code == DYNOCAR_OK ? std::optional(not_taken) : std::nullopt;
    }

  private:
    friend struct detail::Opening;
    explicit Publisher(dynocar_publisher *handle) noexcept : handle_(handle) {}

    std::unique_ptr<dynocar_publisher, detail::Close> handle_;
};

/* The end that reads what the daemon has learned; closes itself. Can be moved, not copied. */
class Reader {
  public:
    /* As dynocar_reader_open(); root as in Publisher::open(). */
    static Opened<Reader> open(std::uint64_t train_id, const char *root = nullptr)
    {
        return detail::Opening::open<Reader>(dynocar_reader_open, train_id, root);
    }

    /* Sets the age (> 0) from which a reading is stale and not usable; 250 ms at first. */
    dynocar_code set_stale_after(std::chrono::nanoseconds age) noexcept
    {
        return dynocar_reader_set_stale_after_ns(handle_.get(), std::int64_t{age.count()});
    }
    /* Takes the messages since the last poll. */
    dynocar_code poll() noexcept { return dynocar_reader_poll(handle_.get(), nullptr); }

    /* The newest polled knowledge of the pipeline that answers a quantity. now_ns: the host's
     * monotonic clock. */
    Reading resistance(std::int64_t now_ns = dynocar_monotonic_now_ns()) noexcept
    {
        return quantity(DYNOCAR_QUANTITY_RESISTANCE, now_ns);
    }
    Reading mass(std::int64_t now_ns = dynocar_monotonic_now_ns()) noexcept
    {
        return quantity(DYNOCAR_QUANTITY_MASS, now_ns);
    }
    Reading adhesion(std::int64_t now_ns = dynocar_monotonic_now_ns()) noexcept
    {
        return quantity(DYNOCAR_QUANTITY_ADHESION, now_ns);
    }
    Reading brake_friction(std::int64_t now_ns = dynocar_monotonic_now_ns()) noexcept
    {
        return quantity(DYNOCAR_QUANTITY_BRAKE_FRICTION, now_ns);
    }
    Reading braking_ratio(std::int64_t now_ns = dynocar_monotonic_now_ns()) noexcept
    {
        return quantity(DYNOCAR_QUANTITY_BRAKING_RATIO, now_ns);
    }
    /* By the quantity's number: DYNOCAR_QUANTITY_... */
    Reading quantity(std::uint32_t number,
                     std::int64_t now_ns = dynocar_monotonic_now_ns()) noexcept
    {
        return picked(dynocar_reader_quantity, number, now_ns);
    }
    /* Of the first pipeline of a kind: DYNOCAR_PIPELINE_... */
    Reading latest(std::uint32_t pipeline_kind,
                   std::int64_t now_ns = dynocar_monotonic_now_ns()) noexcept
    {
        return picked(dynocar_reader_latest, pipeline_kind, now_ns);
    }
    /* By the pipeline's number in the daemon's configuration. */
    Reading latest_by_index(std::uint32_t pipeline_index,
                            std::int64_t now_ns = dynocar_monotonic_now_ns()) noexcept
    {
        return picked(dynocar_reader_latest_by_index, pipeline_index, now_ns);
    }

    /* Counts messages that no sane daemon would send. */
    std::optional<std::uint64_t> refused() noexcept
    {
        std::uint64_t count = 0;
        const auto code = dynocar_reader_refused(handle_.get(), &count);
        return code == DYNOCAR_OK ? std::optional(count) : std::nullopt;
    }

  private:
    friend struct detail::Opening;
    explicit Reader(dynocar_reader *handle) noexcept : handle_(handle) {}

    Reading picked(dynocar_code (*call)(dynocar_reader *, std::uint32_t, std::int64_t,
                                        dynocar_reading *),
                   std::uint32_t number, std::int64_t now_ns) noexcept
    {
        dynocar_reading raw{};
        raw.status = DYNOCAR_STATUS_INVALID;
        raw.is_stale = 1;
        const auto code = call(handle_.get(), number, now_ns, &raw);
        return Reading(code, raw);
    }

    std::unique_ptr<dynocar_reader, detail::Close> handle_;
};

/* Who serves a train: DYNOCAR_DAEMON_..., and in words. */
struct DaemonState {
    std::int32_t state;
    std::string words;
};

/* As dynocar_daemon_state(); nothing to be had is an absent daemon, and the words say why. */
inline DaemonState daemon_state(std::uint64_t train_id, const char *root = nullptr)
{
    std::int32_t state = DYNOCAR_DAEMON_ABSENT;
    char message[DYNOCAR_MESSAGE_BYTES] = "";
    (void)dynocar_daemon_state(root, train_id, &state, message, sizeof message);
    return DaemonState{state, message};
}

} // namespace dynocar

#endif /* DYNOCAR_HPP */
