// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/sim/sensors/event_pixels.h"

#include <algorithm>
#include <limits>
#include <numbers>
#include <optional>
#include <utility>

#include "evpose/core/error.h"

namespace evpose::sim {
namespace {

// Smaller thresholds would trigger on rounding errors.
constexpr double kLeastThreshold = 0.02;
// Validity of the bounds of advance_without_event(); the leak moves them by one per cent of a threshold in
// it.
constexpr TimeNs kHorizon = 100 * kNsPerMs;
// Margin of these bounds for float rounding, in log luminance.
constexpr double kSlack = 2e-6;
constexpr float kInfinity = std::numeric_limits<float>::infinity();
constexpr TimeNs kNever = std::numeric_limits<TimeNs>::max();
// Random stream that selects hot pixels.
constexpr std::uint64_t kHotStream = 1ULL << 40;

double seconds(TimeNs t) { return 1e-9 * static_cast<double>(t); }

struct ValueAndSlope {
  double value, slope;
};

/// Where a monotonic function reaches `level` between `low` and `high`, nanoseconds, where it has the values
/// `at_low` and `at_high`. Newton from the chord, or bisection where that leaves the bracket.
template <class Function>
double root(const Function& function, double level, double low, double high, double at_low, double at_high) {
  const bool rising = at_high > at_low;
  double s = low + (high - low) * (level - at_low) / (at_high - at_low);
  for (int i = 0; i < 100 && high - low > 0.25; ++i) {
    if (!(s >= low && s <= high)) s = 0.5 * (low + high);
    const ValueAndSlope here = function.value_and_slope(s);
    const double miss = here.value - level;
    if ((miss < 0) == rising) {
      low = s;
    } else {
      high = s;
    }
    const double step = -miss / here.slope;
    if (std::abs(step) < 0.5) return std::clamp(s + step, low, high);  // what is left is far smaller
    s += step;
  }
  return high;
}

}  // namespace

/// Log of a luminance that is linear in time, plus leak, s nanoseconds after the start of a span.
class EventPixels::LinearLuminance {
 public:
  LinearLuminance(double from, double to, double length_ns, double offset, double leak_per_ns)
      : from_(from), gain_((to - from) / length_ns), offset_(offset), leak_(leak_per_ns) {}
  double level(double s) const { return from_ + gain_ * s; }
  double log_luminance(double s) const { return std::log(level(s)); }
  double value(double s) const { return log_luminance(s) + offset_ + leak_ * s; }
  ValueAndSlope value_and_slope(double s) const { return {value(s), gain_ / level(s) + leak_}; }
  /// Where the slope is zero; NaN if there is no such point.
  double turn() const {
    return leak_ > 0 && gain_ < 0 ? (-gain_ / leak_ - from_) / gain_
                                  : std::numeric_limits<double>::quiet_NaN();
  }

 private:
  double from_, gain_, offset_, leak_;
};

/// Response of a first-order low pass to a linear log luminance, plus leak. The exponential is good to 3e-7
/// of the swing, far below any threshold.
class EventPixels::LowPassResponse {
 public:
  struct Input {
    double from, to;  ///< log luminance
    double level;     ///< cd/m^2, mean
    double filtered;  ///< at the start
    double length_ns, tau_ns;
  };
  LowPassResponse(const Input& in, double offset, double leak_per_ns)
      : level_(in.level),
        gain_((in.to - in.from) / in.length_ns),
        per_tau_(1 / in.tau_ns),
        start_(in.from - gain_ * in.tau_ns),
        swing_(in.filtered - start_),
        offset_(offset),
        leak_(leak_per_ns) {
    // The slope is zero where the exponential has this value.
    const double rest = (gain_ + leak_) * in.tau_ns / swing_;
    turn_ = rest > kLeast && rest < 1 ? -in.tau_ns * static_cast<double>(fast_log(static_cast<float>(rest)))
                                      : std::numeric_limits<double>::quiet_NaN();
  }
  double level(double) const { return level_; }
  double log_luminance(double s) const { return start_ + gain_ * s + rest(s); }
  double value(double s) const { return log_luminance(s) + offset_ + leak_ * s; }
  ValueAndSlope value_and_slope(double s) const {
    const double now = rest(s);
    return {start_ + gain_ * s + now + offset_ + leak_ * s, gain_ + leak_ - now * per_tau_};
  }
  /// Where the slope is zero; NaN if there is no such point ahead.
  double turn() const { return turn_; }

 private:
  static constexpr double kLeast = 1e-30;  // of the exponential; later, the signal is a straight line
  double rest(double s) const {
    return swing_ * static_cast<double>(fast_exp(static_cast<float>(std::max(-70.0, -s * per_tau_))));
  }
  double level_, gain_, per_tau_, start_, swing_, offset_, leak_, turn_;
};

namespace {

/// First time in (low, high] at which the signal reaches `on` or `off`, in ns from the span's start; it has
/// the value `last` at `high`. The curvature of the signal has one sign, hence one extremum at most.
template <class Signal>
std::optional<std::pair<double, bool>> first_crossing(const Signal& signal, double low, double high,
                                                      double last, double on, double off) {
  const auto crossing = [&](double a, double b, double end) -> std::optional<std::pair<double, bool>> {
    if (end < on && end > off) return std::nullopt;
    const double start = signal.value(a);
    if (end >= on) return std::pair(start >= on ? a : root(signal, on, a, b, start, end), true);
    return std::pair(start <= off ? a : root(signal, off, a, b, start, end), false);
  };
  const double turn = signal.turn();
  if (!(turn > low && turn < high)) return crossing(low, high, last);
  if (const auto found = crossing(low, turn, signal.value(turn))) return found;
  return crossing(turn, high, last);
}

}  // namespace

EventPixels::EventPixels(ImageSize size, const EventCameraConfig& config, std::uint64_t seed,
                         std::vector<float> gain)
    : size_(size),
      config_(config),
      seed_(seed),
      band_limited_(config.bandwidth_hz_per_cd_m2 > 0),
      dark_(static_cast<float>(config.dark_cd_m2)),
      leak_per_s_(config.leak_hz * config.threshold_on),
      refractory_ns_(from_seconds(1e-6 * config.refractory_us)),
      low_(static_cast<std::size_t>(size.width) * static_cast<std::size_t>(size.height)),
      high_(low_.size()),
      filtered_(low_.size()),
      log_last_(low_.size()),
      wake_(low_.size()),
      gain_(std::move(gain)),
      pixels_(low_.size()) {
  if (gain_.empty()) gain_.assign(pixels_.size(), 1);
  EVPOSE_CHECK(gain_.size() == pixels_.size());
  EVPOSE_CHECK(config.dark_cd_m2 > 0 && config.threshold_on > 0 && config.threshold_off > 0);
  if (band_limited_) {
    tau_fast_s_ = 0.5 / (std::numbers::pi * config.bandwidth_max_hz);
    tau_dim_s_ = 0.5 / (std::numbers::pi * config.bandwidth_hz_per_cd_m2);
  }
  for (std::size_t i = 0; i < pixels_.size(); ++i) {
    Pixel& p = pixels_[i];
    p.random = Random(seed, i);
    const auto threshold = [&](double mean) {
      return static_cast<float>(std::max(kLeastThreshold, mean + config.threshold_sigma * p.random.normal()));
    };
    p.on = threshold(config.threshold_on);
    p.off = threshold(config.threshold_off);
  }
}

void EventPixels::start(std::size_t pixel, TimeNs t, float luminance_cd_m2) {
  Pixel& p = pixels_[pixel];
  const double level = std::max(0.0F, luminance_cd_m2) * gain_[pixel] + dark_;
  const double log_level = std::log(level);
  filtered_[pixel] = log_last_[pixel] = static_cast<float>(log_level);
  draw_next_noise(pixel, t);
  // Uniform between the two thresholds.
  const double fraction = config_.reference_spread * p.random.uniform(-1, 1);
  set_reference(p, log_level, t);
  const double offset = fraction * (fraction < 0 ? p.on : p.off);
  p.reference += offset;
  p.log_leak += static_cast<float>(0.5 * offset);
  set_bounds(pixel, t);
}

double EventPixels::hot_rate_hz(std::size_t pixel) const {
  Random random(seed_, kHotStream + pixel);
  if (random.uniform() >= config_.hot_pixel_fraction) return 0;
  return config_.hot_min_hz * std::pow(config_.hot_max_hz / config_.hot_min_hz, random.uniform());
}

void EventPixels::draw_next_noise(std::size_t pixel, TimeNs t) {
  Pixel& p = pixels_[pixel];
  const double rate_hz =
      std::max(config_.shot_noise_dark_hz, config_.shot_noise_bright_hz) + hot_rate_hz(pixel);
  // Beyond the length of any recording.
  constexpr double kLongest_s = 1e9;
  const double wait_s = rate_hz > 0 ? p.random.exponential() / rate_hz : kLongest_s;
  p.next_noise = wait_s < kLongest_s ? t + 1 + static_cast<TimeNs>(1e9 * wait_s) : kNever;
}

bool EventPixels::accept_noise(std::size_t pixel, double level, EventCause& cause) {
  const double hot_hz = hot_rate_hz(pixel);
  const double most_hz = std::max(config_.shot_noise_dark_hz, config_.shot_noise_bright_hz) + hot_hz;
  const double shot_hz =
      config_.shot_noise_bright_hz + (config_.shot_noise_dark_hz - config_.shot_noise_bright_hz) /
                                         (1 + level / config_.shot_noise_half_cd_m2);
  const double draw_hz = most_hz * pixels_[pixel].random.uniform();
  cause = draw_hz < hot_hz ? EventCause::hot : EventCause::shot;
  return draw_hz < hot_hz + shot_hz;
}

void EventPixels::set_reference(Pixel& p, double log_luminance, TimeNs t) const {
  p.reference = log_luminance + leak_per_s_ * seconds(t);
  p.log_leak = static_cast<float>(log_luminance + 0.5 * p.on);
}

void EventPixels::set_bounds(std::size_t pixel, TimeNs t) {
  const Pixel& p = pixels_[pixel];
  wake_[pixel] = std::min(p.next_noise, t + kHorizon);
  double high = p.reference + p.on - leak_per_s_ * seconds(wake_[pixel]) - kSlack;
  double low = p.reference - p.off - leak_per_s_ * seconds(t) + kSlack;
  if (!band_limited_) high = std::exp(high), low = std::exp(low);
  high_[pixel] = static_cast<float>(high);
  low_[pixel] = static_cast<float>(low);
}

void EventPixels::fire(std::size_t pixel, TimeNs t, bool on, EventCause cause,
                       std::vector<SimEvent>& events) const {
  SimEvent event;
  event.t = t;
  const auto width = static_cast<std::size_t>(size_.width);
  event.x = static_cast<std::uint16_t>(pixel % width);
  event.y = static_cast<std::uint16_t>(pixel / width);
  event.on = on;
  event.cause = cause;
  events.push_back(event);
}

template <class Signal>
void EventPixels::emit_events(std::size_t pixel, TimeNs t0, TimeNs t1, const Signal& signal,
                              std::vector<SimEvent>& events) {
  Pixel& p = pixels_[pixel];
  const auto since = [&](TimeNs t) { return static_cast<double>(t - t0); };
  const double last = signal.value(since(t1));
  TimeNs now = t0;
  while (true) {
    if (high_[pixel] == kInfinity) {  // in reset: the reference follows the signal
      if (wake_[pixel] > t1) return;
      now = std::max(now, wake_[pixel]);
      set_reference(p, signal.log_luminance(since(now)), now);
      high_[pixel] = low_[pixel] = 0;
    }
    while (p.next_noise < now) draw_next_noise(pixel, p.next_noise);  // noise during a reset is lost
    const auto crossing =
        first_crossing(signal, since(now), since(t1), last, p.reference + p.on, p.reference - p.off);
    const TimeNs t_crossing =
        crossing ? std::clamp(t0 + static_cast<TimeNs>(std::ceil(crossing->first)), t0 + 1, t1) : kNever;
    if (std::min(t_crossing, p.next_noise) > t1) break;
    if (p.next_noise <= t_crossing) {
      now = p.next_noise;
      draw_next_noise(pixel, now);
      EventCause cause{};
      if (!accept_noise(pixel, signal.level(since(now)), cause)) continue;
      fire(pixel, now, (p.random.bits() & 1) != 0, cause, events);
      set_reference(p, signal.log_luminance(since(now)), now);
    } else {
      now = t_crossing;
      const bool on = crossing->second;
      const double log_luminance = signal.log_luminance(since(now));
      const bool leaked = on && log_luminance < p.log_leak;
      fire(pixel, now, on, leaked ? EventCause::leak : EventCause::signal, events);
      p.reference += on ? p.on : -p.off;
      p.log_leak = static_cast<float>(log_luminance + 0.5 * p.on);
    }
    if (refractory_ns_ > 0) {
      low_[pixel] = -kInfinity;
      high_[pixel] = kInfinity;
      wake_[pixel] = now + refractory_ns_;
    }
  }
  set_bounds(pixel, t1);
}

void EventPixels::advance_unfiltered(std::size_t pixel, const Span& span, std::vector<SimEvent>& events) {
  const double from = std::max(0.0, span.from) + dark_, to = std::max(0.0, span.to) + dark_;
  const LinearLuminance ramp(from, to, static_cast<double>(span.t1 - span.t0), leak_per_s_ * seconds(span.t0),
                             1e-9 * leak_per_s_);
  emit_events(pixel, span.t0, span.t1, ramp, events);
}

void EventPixels::advance_filtered(std::size_t pixel, const Span& span, std::vector<SimEvent>& events) {
  float &log_last = log_last_[pixel], &filtered = filtered_[pixel];
  const double from = std::max(0.0, span.from) + dark_, to = std::max(0.0, span.to) + dark_;
  const auto change = static_cast<double>(fast_log(static_cast<float>(to / from)));
  const int steps = 1 + static_cast<int>(std::abs(change) / kSmallChange);
  double level = from;
  TimeNs t = span.t0;
  for (int i = 1; i <= steps; ++i) {
    const double next = i == steps ? to : from * std::exp(change * i / steps);
    const TimeNs t_next = i == steps ? span.t1
                                     : span.t0 + static_cast<TimeNs>(static_cast<double>(span.t1 - span.t0) *
                                                                     (next - from) / (to - from));
    if (t_next > t) {
      const double mean = 0.5 * (level + next), length_ns = static_cast<double>(t_next - t);
      const float log_next = fast_log(static_cast<float>(next));
      const LowPassResponse response(
          {log_last, log_next, mean, filtered, length_ns, 1e9 * time_constant_s(mean)},
          leak_per_s_ * seconds(t), 1e-9 * leak_per_s_);
      emit_events(pixel, t, t_next, response, events);
      filtered = static_cast<float>(response.log_luminance(length_ns));
      log_last = log_next;
    }
    level = next;
    t = t_next;
  }
}

}  // namespace evpose::sim
