// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/io/recording/recording_yaml.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <map>

#include "evpose/core/config.h"
#include "evpose/io/files/numbers.h"
#include "evpose/io/files/yaml_document.h"
#include "evpose/io/formats/event_formats.h"

namespace evpose {
namespace {

constexpr std::int64_t kVersion = 1;
constexpr double kLargestOffset = 2e9;  // s
constexpr double kLargestTime = static_cast<double>(kLargestTimeNs) * 1e-9;

/// What reads the value of one key.
using Apply = std::function<Status(const YamlNode&, const std::string& key)>;

/// The keys of recording.yaml and where their values go.
class Keys {
 public:
  Keys(const YamlDocument& document, RecordingOverrides& out);

  /// Applies all members of a map whose own key is `prefix`.
  Status apply(const YamlNode& node, const std::string& prefix) const;

 private:
  void add_files();
  void add_events();
  void add_imu();
  void add_time();
  void add_frames();
  void add_frame_camera();
  Apply file(std::optional<std::string>& target) const;
  Apply text_value(std::string& target) const;
  Apply flag(bool& target) const;
  Apply choice(std::vector<std::string> choices, std::function<void(const std::string&)> set) const;
  Apply seconds(std::optional<double>& target, double limit) const;
  Apply transform(std::optional<Pose>& target) const;
  Apply number(double min, double max, const char* unit, std::function<void(double)> set) const;
  Status event_format(const YamlNode& node, const std::string& key) const;
  Status resolution(const YamlNode& node, const std::string& key) const;
  Status initial_pose(const YamlNode& node) const;

  const YamlDocument& document_;
  RecordingOverrides& out_;
  std::map<std::string, Apply> keys_;
};

Keys::Keys(const YamlDocument& document, RecordingOverrides& out) : document_(document), out_(out) {
  keys_["version"] = [this](const YamlNode& node, const std::string& key) -> Status {
    const auto version = document_.integer(node, key);
    if (!version) return version.error();
    if (*version < 1 || *version > kVersion)
      return document_.error(node, text("version ", *version, " is not known, only ", kVersion),
                             "use a newer program");
    return {};
  };
  keys_["name"] = text_value(out_.name);
  for (const char* key : {"description", "created_by"})
    keys_[key] = [this](const YamlNode& node, const std::string& k) -> Status {
      const auto value = document_.string(node, k);
      return value ? Status() : Status(value.error());
    };
  add_files();
  add_events();
  add_imu();
  add_time();
  add_frames();
  add_frame_camera();
}

void Keys::add_files() {
  keys_["files.events"] = file(out_.events);
  keys_["files.imu"] = file(out_.imu);
  keys_["files.groundtruth"] = file(out_.groundtruth);
  keys_["files.calibration"] = file(out_.calibration);
  keys_["files.imu_model"] = file(out_.imu_model);
  keys_["files.contours"] = file(out_.contours);
  keys_["files.map"] = file(out_.map);
  keys_["files.frames"] = file(out_.frames);
}

void Keys::add_events() {
  keys_["events.format"] = [this](const YamlNode& node, const std::string& key) {
    return event_format(node, key);
  };
  keys_["events.topic"] = text_value(out_.event_options.topic);
  keys_["events.time_unit"] =
      choice({"us", "ns", "s"}, [this](const auto& v) { out_.event_options.time_unit = v; });
  keys_["events.resolution"] = [this](const YamlNode& node, const std::string& key) {
    return resolution(node, key);
  };
  keys_["events.flip_x"] = flag(out_.event_options.flip_x);
  keys_["events.flip_y"] = flag(out_.event_options.flip_y);
  keys_["events.swap_polarity"] = flag(out_.event_options.swap_polarity);
  keys_["events.camera"] = [this](const YamlNode& node, const std::string& key) -> Status {
    const auto index = document_.integer(node, key);
    if (!index) return index.error();
    if (*index < 0 || *index > 99)
      return document_.error(node, text(key, ": no camera ", *index), "count from 0");
    out_.camera_index = static_cast<int>(*index);
    return {};
  };
}

void Keys::add_imu() {
  keys_["imu.topic"] = text_value(out_.imu_topic);
  keys_["imu.time_unit"] = choice({"ns", "us", "s"}, [this](const auto& v) {
    out_.imu_options.time_unit = v;
    out_.states_imu_layout = true;
  });
  keys_["imu.gyro_unit"] = choice({"rad/s", "deg/s"}, [this](const auto& v) {
    out_.imu_options.gyro_in_degrees = v == "deg/s";
    out_.states_gyro_unit = true;
  });
  keys_["imu.accel_unit"] = choice({"m/s^2", "g"}, [this](const auto& v) {
    out_.imu_options.accel_in_g = v == "g";
    out_.states_accel_unit = true;
  });
  keys_["imu.columns"] = [this](const YamlNode& node, const std::string& key) -> Status {
    if (node.kind != YamlNode::Kind::list)
      return document_.error(node, key + ": a list is expected", "write [a, b, ...]");
    for (const YamlNode& item : node.items) {
      const auto name = document_.string(item, key);
      if (!name) return name.error();
      out_.imu_options.columns.push_back(*name);
      out_.states_imu_layout = true;
    }
    return {};
  };
}

void Keys::add_time() {
  keys_["time.offset_events_s"] = seconds(out_.offset_events_s, kLargestOffset);
  keys_["time.offset_groundtruth_s"] = seconds(out_.offset_groundtruth_s, kLargestOffset);
  keys_["time.t_start_s"] = seconds(out_.t_start_s, kLargestTime);
  keys_["time.t_end_s"] = seconds(out_.t_end_s, kLargestTime);
}

void Keys::add_frames() {
  keys_["groundtruth.body"] =
      choice({"imu", "camera", "marker"}, [this](const auto& v) { out_.groundtruth_body = v; });
  keys_["groundtruth.T_body_imu"] = transform(out_.T_body_imu);
  keys_["groundtruth.world"] = text_value(out_.world_frame);
  keys_["frames.map"] = text_value(out_.map_frame);
  keys_["frames.T_map_world"] = transform(out_.T_map_world);
  keys_["frames.T_ned_map"] = [this](const YamlNode& node, const std::string& key) -> Status {
    const auto pose = document_.transform(node, key);
    if (!pose) return pose.error();
    out_.T_ned_map = pose->matrix();
    return {};
  };
  for (const char* part : {"t_ns", "p", "q_xyzw", "sigma_p", "sigma_q_deg"})
    keys_[std::string("initial_pose.") + part] = nullptr;  // read together, by initial_pose()
}

void Keys::add_frame_camera() {
  keys_["frame_camera.gamma"] = number(0.2, 5, "", [this](double v) { out_.frame_camera.gamma = v; });
  keys_["frame_camera.row_time_us"] =
      number(-1000, 1000, "us", [this](double v) { out_.frame_camera.row_time_s = 1e-6 * v; });
  keys_["frame_camera.exposure_ms"] =
      number(0, 1000, "ms", [this](double v) { out_.frame_options.exposure = from_seconds(1e-3 * v); });
  keys_["frame_camera.stamp"] = choice({"start", "middle", "end"}, [this](const auto& v) {
    using Stamp = FrameReadOptions::Stamp;
    out_.frame_options.stamp = v == "start" ? Stamp::start : v == "end" ? Stamp::end : Stamp::middle;
  });
}

Status Keys::apply(const YamlNode& node, const std::string& prefix) const {
  for (const auto& [name, member] : node.members) {
    const std::string key = prefix.empty() ? name : prefix + "." + name;
    const auto known = keys_.find(key);
    if (known != keys_.end()) {
      if (!known->second) continue;
      if (auto status = known->second(member, key); !status) return status;
      continue;
    }
    const bool group = std::any_of(keys_.begin(), keys_.end(),
                                   [&](const auto& k) { return k.first.starts_with(key + "."); });
    if (group && member.kind == YamlNode::Kind::null) continue;
    if (!group || member.kind != YamlNode::Kind::map) {
      std::vector<std::string> names;
      for (const auto& [k, apply_value] : keys_) names.push_back(k);
      return document_.error(member, "unknown key '" + key + "'",
                             "did you mean '" + nearest_word(key, names) + "'?");
    }
    if (auto status = apply(member, key); !status) return status;
    if (key == "initial_pose") {
      if (auto status = initial_pose(member); !status) return status;
    }
  }
  return {};
}

Apply Keys::file(std::optional<std::string>& target) const {
  return [this, &target](const YamlNode& node, const std::string& key) -> Status {
    const auto name = document_.string(node, key);
    if (!name) return name.error();
    const std::string inside = "/" + *name + "/";
    if (name->empty() || name->starts_with('/') || inside.find("/../") != std::string::npos)
      return document_.error(node, key + ": '" + *name + "' does not stay inside the folder",
                             "name a file below the recording's folder");
    target = *name;
    return {};
  };
}

Apply Keys::text_value(std::string& target) const {
  return [this, &target](const YamlNode& node, const std::string& key) -> Status {
    const auto value = document_.string(node, key);
    if (!value) return value.error();
    target = *value;
    return {};
  };
}

Apply Keys::flag(bool& target) const {
  return [this, &target](const YamlNode& node, const std::string& key) -> Status {
    const auto value = document_.boolean(node, key);
    if (!value) return value.error();
    target = *value;
    return {};
  };
}

Apply Keys::choice(std::vector<std::string> choices, std::function<void(const std::string&)> set) const {
  return [this, choices = std::move(choices), set = std::move(set)](const YamlNode& node,
                                                                    const std::string& key) -> Status {
    if (node.kind == YamlNode::Kind::scalar &&
        std::find(choices.begin(), choices.end(), node.scalar) != choices.end()) {
      set(node.scalar);
      return {};
    }
    std::string list;
    for (const auto& c : choices) list += (list.empty() ? "" : " | ") + c;
    return document_.error(node, key + ": '" + node.scalar + "' is none of " + list, "use one of them");
  };
}

Apply Keys::seconds(std::optional<double>& target, double limit) const {
  return [this, &target, limit](const YamlNode& node, const std::string& key) -> Status {
    const auto value = document_.number(node, key);
    if (!value) return value.error();
    if (std::abs(*value) > limit)
      return document_.error(node, text(key, ": ", *value, " s is out of range"), "give seconds");
    target = *value;
    return {};
  };
}

Apply Keys::number(double min, double max, const char* unit, std::function<void(double)> set) const {
  return [=, this, set = std::move(set)](const YamlNode& node, const std::string& key) -> Status {
    const auto value = document_.number(node, key);
    if (!value) return value.error();
    if (!(*value >= min && *value <= max))
      return document_.error(node, text(key, ": ", *value, " is out of range"),
                             text("give a number from ", min, " to ", max, " ", unit));
    set(*value);
    return {};
  };
}

Apply Keys::transform(std::optional<Pose>& target) const {
  return [this, &target](const YamlNode& node, const std::string& key) -> Status {
    const auto value = document_.transform(node, key);
    if (!value) return value.error();
    target = *value;
    return {};
  };
}

Status Keys::event_format(const YamlNode& node, const std::string& key) const {
  const auto value = document_.string(node, key);
  if (!value) return value.error();
  std::string known;
  for (const EventFormat& format : event_formats()) {
    if (*value == format.name) {
      out_.events_format = *value;
      return {};
    }
    known += (known.empty() ? "" : ", ") + std::string(format.name);
  }
  return document_.error(node, key + ": '" + *value + "' is unknown", "use one of " + known);
}

Status Keys::resolution(const YamlNode& node, const std::string& key) const {
  const auto size = document_.numbers(node, key, 2);
  if (!size) return size.error();
  for (const double n : *size)
    if (n < 1 || n > 32767 || n != std::floor(n))
      return document_.error(node, text(key, ": ", n, " is not a number of pixels"), "write [width, height]");
  out_.event_options.size = {static_cast<int>((*size)[0]), static_cast<int>((*size)[1])};
  return {};
}

Status Keys::initial_pose(const YamlNode& node) const {
  InitialPose pose;
  const YamlNode *t = node.find("t_ns"), *p = node.find("p"), *q = node.find("q_xyzw");
  if (t == nullptr || p == nullptr || q == nullptr)
    return document_.error(node, "initial_pose needs t_ns, p and q_xyzw", "add them");
  const auto time = document_.integer(*t, "initial_pose.t_ns");
  if (!time) return time.error();
  if (*time > kLargestTimeNs || *time < -kLargestTimeNs)
    return document_.error(*t, "initial_pose.t_ns is out of range", "give nanoseconds on the IMU's clock");
  const auto position = document_.numbers(*p, "initial_pose.p", 3);
  if (!position) return position.error();
  const auto rotation = document_.numbers(*q, "initial_pose.q_xyzw", 4);
  if (!rotation) return rotation.error();
  const auto& r = *rotation;
  pose.t = *time;
  pose.T_map_body = {Eigen::Quaterniond(r[3], r[0], r[1], r[2]),
                     {(*position)[0], (*position)[1], (*position)[2]}};
  if (!(std::abs(pose.T_map_body.q.norm() - 1) <= 1e-2))
    return document_.error(*q, text("initial_pose.q_xyzw: norm ", pose.T_map_body.q.norm(), ", not 1"),
                           "give a unit quaternion");
  pose.T_map_body.q.normalize();
  for (const auto& [key, target] :
       {std::pair("sigma_p", &pose.sigma_p_m), std::pair("sigma_q_deg", &pose.sigma_q_deg)}) {
    const YamlNode* sigma = node.find(key);
    if (sigma == nullptr) continue;
    const auto value = document_.number(*sigma, std::string("initial_pose.") + key);
    if (!value) return value.error();
    if (*value <= 0)
      return document_.error(*sigma, text("initial_pose.", key, ": ", *value), "give a positive number");
    *target = *value;
  }
  out_.initial_pose = pose;
  return {};
}

}  // namespace

Expected<RecordingOverrides> read_recording_yaml(const std::string& path) {
  const auto document = YamlDocument::read(path);
  if (!document) return document.error();
  RecordingOverrides out;
  if (document->root.kind == YamlNode::Kind::null) return out;
  if (document->root.kind != YamlNode::Kind::map)
    return document->error(document->root, "no settings", "write `key: value` lines");
  const Keys keys(*document, out);
  if (auto status = keys.apply(document->root, ""); !status) return status.error();
  return out;
}

}  // namespace evpose
