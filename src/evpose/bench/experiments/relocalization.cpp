// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/bench/experiments/relocalization.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <ctime>
#include <random>
#include <utility>

#include "evpose/bench/experiments/start_looks.h"
#include "evpose/core/parallel.h"
#include "evpose/io/files/atomic_file.h"
#include "evpose/relocalization/place_index.h"

namespace evpose::experiments {
namespace {

constexpr double kLocked_m = 0.01;
constexpr double kUnknownSpeed_m_s = 0.5, kUnknownRate_rad_s = 0.5;  // 1 sigma of a start at rest

/// How far off a start is: by so much in a random direction; with sigmas like those of GPS and a compass; or
/// nothing is known of it.
enum class StartError : std::uint8_t { exactly, like_gps, anywhere };
struct StartClass {
  const char* name;
  double position_m, rotation_deg;
  StartError error = StartError::exactly;
};
constexpr std::array<StartClass, 6> kClasses{{{"5 cm, 0.5 deg", 0.05, 0.5},
                                              {"10 cm, 2 deg", 0.1, 2},
                                              {"30 cm, 5 deg", 0.3, 5},
                                              {"50 cm, 10 deg", 0.5, 10},
                                              {"GPS-like", 3, 20, StartError::like_gps},
                                              {"anywhere", 1e3, 180, StartError::anywhere}}};

struct StartOutcome {
  Health health = Health::waiting;
  double error_mm = 0, found_after_s = -1;
  double beyond_mm = 0;  ///< largest error called tracking and beyond three of its sigmas in an axis
  double search_s = 0;   ///< of the processor
  std::string looks;
};

/// What no pose can be found in, or none near the start.
enum class Wrong : std::uint8_t { another_place, mirrored, start_3_m_off, noise, nothing };
constexpr std::array<const char*, 5> kWrongNames{"map of another place", "mirrored map", "start 3 m off",
                                                 "white noise for events", "nothing"};
constexpr double kBeyond_sigmas = 3;
constexpr double kWatched_s = 1.5;
constexpr double kFarStart_m = 3;

struct WrongOutcome {
  int updates = 0;
  int beyond = 0;    ///< with a pose further off than three of its sigmas in an axis
  int tracking = 0;  ///< of these, called so
  Health at_end = Health::waiting;
  std::string looks;
};

/// Time of this thread's processor.
double processor_s() {
  timespec t{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
  return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}

double uniform(std::mt19937& random) { return (static_cast<double>(random()) + 0.5) / 4294967296.0; }

Eigen::Vector3d direction(std::mt19937& random) {
  const double z = 2 * uniform(random) - 1, a = 2 * M_PI * uniform(random), r = std::sqrt(1 - z * z);
  return {r * std::cos(a), r * std::sin(a), z};
}

double normal(std::mt19937& random) {
  return std::sqrt(-2 * std::log(uniform(random))) * std::cos(2 * M_PI * uniform(random));
}

Eigen::Vector3d middle_of(const ContourMap& map) {
  Eigen::AlignedBox3f box;
  for (const ContourPoint& p : map.points) box.extend(p.position);
  return map.anchor + box.center().cast<double>();
}

/// A time at which so much of the recording is left, if it is that long.
TimeNs random_begin(const std::vector<TimedPose>& truth, double left_s, std::mt19937& random) {
  const TimeNs first = truth.front().t + 10 * kNsPerMs;
  const double slack_s = to_seconds(truth.back().t - first) - left_s - 0.05;
  return first + from_seconds(uniform(random) * std::max(1e-3, slack_s));
}

/// The true pose with an error of that class; neither velocity nor rate is known.
StartState wrong_start(const std::vector<TimedPose>& truth, TimeNs t, const StartClass& from,
                       const Eigen::Vector3d& middle, std::mt19937& random) {
  StartState state = start_at(truth, t);
  const double rotation_rad = from.rotation_deg * M_PI / 180;
  Vector6d error = Vector6d::Zero();
  if (from.error == StartError::exactly) {
    error.head<3>() = from.position_m * direction(random);
    error.tail<3>() = rotation_rad * direction(random);
  }
  if (from.error == StartError::like_gps) {
    for (int k = 0; k < 3; ++k) state.T_map_body.p[k] += from.position_m * normal(random);
    state.T_map_body.q = so3::exp({0, 0, rotation_rad * normal(random)}) * state.T_map_body.q;
  }
  if (from.error == StartError::anywhere) state.T_map_body = {Eigen::Quaterniond::Identity(), middle};
  state.T_map_body = state.T_map_body.plus(error);
  state.velocity.setZero();
  state.angular_rate_body.setZero();
  return state;
}

TrackerConfig unsure_of_start(TrackerConfig config, const StartClass& from) {
  const double axes = from.error == StartError::exactly ? std::sqrt(3) : 1;
  config.fusion.start_position_sigma_m = from.position_m / axes;
  config.fusion.start_rotation_sigma_rad = from.rotation_deg * M_PI / 180 / axes;
  config.fusion.start_velocity_sigma_m_s = kUnknownSpeed_m_s;
  config.fusion.start_angular_rate_sigma_rad_s = kUnknownRate_rad_s;
  return config;
}

/// Further from the truth than three of its sigmas in an axis.
bool is_beyond(const Update& u, const std::vector<TimedPose>& truth) {
  const Vector6d e = u.T_map_body.minus(start_at(truth, u.t).T_map_body);
  const Vector6d sigma = u.covariance.diagonal().cwiseSqrt();
  return (e.cwiseAbs().array() > kBeyond_sigmas * sigma.array()).any();
}

/// As with a map that `evpose map index` made: what is seen from where is not looked at anew in each start.
struct IndexedStreams {
  std::string name;
  const Streams& streams;
  PlaceCache places;  ///< each start has its own copy: the order of starts does not matter
};

IndexedStreams indexed(const std::string& name, const Streams& streams) {
  IndexedStreams out{name, streams, {}};
  const ContourIndex contours(*streams.job.setup.map);
  out.places.over(contours, streams.job.config.tracker.visible, space_around(contours.map()));
  return out;
}

StartOutcome start(const IndexedStreams& all, const StartClass& from, double within_s, unsigned seed) {
  const Streams& streams = all.streams;
  std::mt19937 random(seed);
  const std::vector<TimedPose>& truth = streams.job.truth;
  const TimeNs begin = random_begin(truth, within_s, random);
  const TimeNs end = begin + from_seconds(within_s + 0.01);
  const auto [packets, imu] = excerpt(streams, begin, end);
  const StartState state = wrong_start(truth, begin, from, middle_of(*streams.job.setup.map), random);
  TrackerSetup setup = streams.job.setup;
  setup.places = std::make_shared<PlaceCache>(all.places);
  StartOutcome out;
  StartLooks looks({all.name, from.name, seed}, begin, truth);
  auto tracker =
      Tracker::create(setup, unsure_of_start(streams.job.config.tracker, from), state, processor_s);
  if (!tracker) return out;
  (*tracker)->on_update([&](const Update& u) {
    if (u.t > begin + from_seconds(within_s)) return;
    out.health = u.health;
    looks.add(u);
    if (u.points == 0) out.search_s += u.times.predict_s;
    const bool tracking = u.health == Health::tracking || u.health == Health::degraded;
    out.error_mm = 1e3 * u.T_map_body.minus(start_at(truth, u.t).T_map_body).head<3>().norm();
    if (u.health == Health::tracking && is_beyond(u, truth))
      out.beyond_mm = std::max(out.beyond_mm, out.error_mm);
    const bool locked = tracking && out.error_mm < 1e3 * kLocked_m;
    if (!locked) out.found_after_s = -1;
    if (locked && out.found_after_s < 0) out.found_after_s = to_seconds(u.t - begin);
  });
  feed(packets, imu, **tracker);
  (*tracker)->events_complete_until(end);
  out.looks = looks.rows();
  return out;
}

std::vector<StartOutcome> start_all(const IndexedStreams& streams, const StartClass& from,
                                    const RelocalizationRequest& request) {
  std::vector<StartOutcome> outcomes(static_cast<std::size_t>(request.seeds));
  ThreadPool pool(request.threads);
  pool.for_chunks(outcomes.size(), 1, [&](std::size_t, std::size_t i, std::size_t) {
    outcomes[i] = start(streams, from, request.within_s, static_cast<unsigned>(1 + i));
  });
  return outcomes;
}

double percentile(std::vector<double> v, double share) {
  if (v.empty()) return std::nan("");
  std::sort(v.begin(), v.end());
  return v[static_cast<std::size_t>(std::lround(share * static_cast<double>(v.size() - 1)))];
}

void print_row(const std::string& name, const StartClass& from, const std::vector<StartOutcome>& outcomes) {
  int locked = 0, wrong = 0, degraded = 0, beyond = 0;
  double worst_mm = 0;
  std::vector<double> times, errors, search;
  for (const StartOutcome& o : outcomes) {
    search.push_back(1e3 * o.search_s);
    beyond += o.beyond_mm > 0 ? 1 : 0;
    worst_mm = std::max(worst_mm, o.beyond_mm);
    if (o.found_after_s >= 0) {
      ++locked;
      times.push_back(o.found_after_s);
      errors.push_back(o.error_mm);
    } else {
      wrong += o.health == Health::tracking ? 1 : 0;
      degraded += o.health == Health::degraded ? 1 : 0;
    }
  }
  std::printf("| %s | %s | %d | %d | %d | %d | %.2f | %.1f | %.0f | %.0f | %d | %.0f |\n", name.c_str(),
              from.name, locked, wrong, degraded,
              static_cast<int>(outcomes.size()) - locked - wrong - degraded, percentile(times, 0.5),
              percentile(errors, 0.5), percentile(search, 0.5), percentile(search, 0.95), beyond, worst_mm);
  std::fflush(stdout);
}

ContourMap mirrored(ContourMap map) {
  const auto mirror = [](Eigen::Vector3f& v) { v.y() = -v.y(); };
  float low = map.points.front().position.y(), high = low;
  for (const ContourPoint& p : map.points)
    low = std::min(low, p.position.y()), high = std::max(high, p.position.y());
  map.anchor.y() += low + high;  // so that it fills the same room
  for (ContourPoint& p : map.points) {
    mirror(p.position), mirror(p.normal), mirror(p.tangent), mirror(p.normal_b);
  }
  for (Eigen::Vector3f& v : map.occluders.vertices) mirror(v);
  for (MapPlane& plane : map.planes) mirror(plane.normal);
  for (MapPolygon& polygon : map.polygons)
    for (Eigen::Vector3f& v : polygon.vertices) mirror(v);
  return map;
}

/// A start from the truth, with what makes it wrong.
WrongOutcome start_wrong(const std::string& name, const Streams& streams, Wrong wrong,
                         std::shared_ptr<const ContourMap> map, unsigned seed) {
  std::mt19937 random(seed);
  const std::vector<TimedPose>& truth = streams.job.truth;
  const TimeNs begin = random_begin(truth, kWatched_s, random);
  const TimeNs end = begin + from_seconds(kWatched_s);
  auto [packets, imu] = excerpt(streams, begin, end);
  StartState state = start_at(truth, begin);
  if (wrong == Wrong::start_3_m_off) state.T_map_body.p += kFarStart_m * direction(random);
  TrackerSetup setup = streams.job.setup;
  if (map) setup.map = std::move(map);
  if (wrong == Wrong::noise)
    for (EventPacket& packet : packets)
      for (Event& e : packet.events)
        e = make_event(e.dt_us, static_cast<int>(uniform(random) * setup.camera->size().width),
                       static_cast<int>(uniform(random) * setup.camera->size().height), e.on);
  WrongOutcome out;
  auto tracker = Tracker::create(setup, streams.job.config.tracker, state);
  if (!tracker) return out;
  StartLooks looks({name, kWrongNames[static_cast<std::size_t>(wrong)], seed}, begin, truth);
  (*tracker)->on_update([&](const Update& u) {
    ++out.updates;
    looks.add(u);
    out.at_end = u.health;
    // From a start that is off, the right pose may be found; and what is in view may be symmetric.
    if (!has_pose(u.health) || !is_beyond(u, truth)) return;
    ++out.beyond;
    out.tracking += u.health == Health::tracking ? 1 : 0;
  });
  feed(packets, imu, **tracker);
  (*tracker)->events_complete_until(end);
  out.looks = looks.rows();
  return out;
}

/// Null if the map stays, or if there is none of another place.
std::shared_ptr<const ContourMap> wrong_map(Wrong wrong, const Streams& streams,
                                            const std::vector<Streams>& all) {
  if (wrong == Wrong::mirrored) return std::make_shared<const ContourMap>(mirrored(*streams.job.setup.map));
  if (wrong != Wrong::another_place) return nullptr;
  const auto other = std::find_if(all.begin(), all.end(), [&](const Streams& s) {
    return s.job.setup.map->points.size() != streams.job.setup.map->points.size();
  });
  return other == all.end() ? nullptr : other->job.setup.map;
}

void print_wrong(const std::string& name, const Streams& streams, const std::vector<Streams>& all,
                 const RelocalizationRequest& request, std::string* looks) {
  for (const Wrong wrong :
       {Wrong::another_place, Wrong::mirrored, Wrong::start_3_m_off, Wrong::noise, Wrong::nothing}) {
    const std::shared_ptr<const ContourMap> map = wrong_map(wrong, streams, all);
    if (wrong == Wrong::another_place && !map) continue;
    std::vector<WrongOutcome> outcomes(static_cast<std::size_t>(request.seeds));
    ThreadPool pool(request.threads);
    pool.for_chunks(outcomes.size(), 1, [&](std::size_t, std::size_t i, std::size_t) {
      outcomes[i] = start_wrong(name, streams, wrong, map, static_cast<unsigned>(1 + i));
    });
    int tracking = 0, lost = 0;
    double updates = 0, called = 0, beyond = 0;
    for (const WrongOutcome& o : outcomes) {
      tracking += o.tracking > 0 ? 1 : 0;
      lost += o.at_end == Health::lost ? 1 : 0;
      updates += o.updates, called += o.tracking, beyond += o.beyond;
      *looks += o.looks;
    }
    std::printf("| %s | %s | %d | %.1f | %.1f | %d |\n", name.c_str(),
                kWrongNames[static_cast<std::size_t>(wrong)], tracking, 100 * called / std::max(1.0, updates),
                100 * beyond / std::max(1.0, updates), lost);
    std::fflush(stdout);
  }
}

void print_all_wrong(const std::vector<BenchRecording>& recordings, const std::vector<Streams>& all,
                     const RelocalizationRequest& request, std::string* looks) {
  std::printf(
      "\n%d starts each from the true pose, watched for %.1f s, with what cannot be tracked. Beyond: an "
      "error of more than 3 sigma in an axis.\n\n"
      "| recording | what is wrong | starts ever called tracking, and beyond | %% of updates called so | "
      "%% of updates with a pose beyond | starts lost at the end |\n|---|---|---|---|---|---|\n",
      request.seeds, kWatched_s);
  for (std::size_t i = 0; i < all.size(); ++i) print_wrong(recordings[i].name, all[i], all, request, looks);
}

constexpr char kWrong[] = "wrong";  // among the classes: what cannot be tracked

bool is_wanted(const std::string& what, const RelocalizationRequest& request) {
  const auto begins = [&](const std::string& name) { return what.starts_with(name); };
  return request.classes.empty() || std::any_of(request.classes.begin(), request.classes.end(), begins);
}

void print_starts(const std::string& name, const Streams& streams, const RelocalizationRequest& request,
                  std::string* looks) {
  const IndexedStreams with_places = indexed(name, streams);
  for (const StartClass& from : kClasses)
    if (is_wanted(from.name, request)) {
      const std::vector<StartOutcome> outcomes = start_all(with_places, from, request);
      print_row(name, from, outcomes);
      for (const StartOutcome& o : outcomes) *looks += o.looks;
    }
}

}  // namespace

Status print_relocalization(const RelocalizationRequest& request) {
  const auto config = configure(request.selection.assignments);
  if (!config) return config.error();
  const auto recordings = select_recordings(request.selection);
  if (!recordings) return recordings.error();
  std::vector<Streams> all;
  for (const BenchRecording& recording : *recordings) {
    auto streams = load_streams(recording, *config);
    if (!streams) return streams.error();
    if (!request.imu) {
      streams->imu.clear();
      streams->job.setup.motion = MotionModel::constant_velocity;
    }
    all.push_back(std::move(*streams));
  }
  if (std::ranges::any_of(kClasses, [&](const StartClass& c) { return is_wanted(c.name, request); }))
    std::printf(
        "%d starts each, anywhere in the recording, velocity unknown%s. Locked: within %.0f mm after %.1f "
        "s.\n\n"
        "| recording | start off by | locked | wrong called tracking | wrong called degraded | not found | "
        "median s to lock | median error mm | search ms p50 | p95 | ever "
        "tracking and beyond 3 sigma | worst of these mm "
        "|\n|---|---|---|---|---|---|---|---|---|---|---|---|\n",
        request.seeds, request.imu ? "" : ", no IMU", 1e3 * kLocked_m, request.within_s);
  std::string looks = StartLooks::header();
  for (std::size_t i = 0; i < all.size(); ++i) print_starts((*recordings)[i].name, all[i], request, &looks);
  if (is_wanted(kWrong, request)) print_all_wrong(*recordings, all, request, &looks);
  return request.looks.empty() ? Status{} : write_text_file(request.looks, looks);
}

}  // namespace evpose::experiments
