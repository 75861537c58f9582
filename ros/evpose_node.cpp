// SPDX-License-Identifier: BSD-3-Clause
// ROS 1 node: topics `events` (dvs_msgs, prophesee_event_msgs, event_camera_msgs) and `imu` in; `odom`, `path`, `map`,
// tf map -> base_link and /diagnostics out; service `reset`. Parameters: docs/use/live.md.
#include <diagnostic_msgs/DiagnosticArray.h>
#include <geometry_msgs/PoseStamped.h>
#include <nav_msgs/Odometry.h>
#include <nav_msgs/Path.h>
#include <ros/ros.h>
#include <sensor_msgs/Imu.h>
#include <sensor_msgs/PointCloud2.h>
#include <std_srvs/Empty.h>
#include <tf2_ros/transform_broadcaster.h>
#include <topic_tools/shape_shifter.h>

#include <algorithm>
#include <cstdio>
#include <cstring>

#include "engine.h"

namespace evpose_ros {
namespace {

constexpr double kPath_s = 0.1, kDiagnostics_s = 1;
constexpr std::size_t kMostPath = 3000;

/// Messages of topics to the engine, on ROS's own thread.
class Topics {
 public:
  Topics(ros::NodeHandle& node, Engine& engine) : engine_(engine) {
    const auto no_delay = ros::TransportHints().tcpNoDelay();
    events_ = node.subscribe("events", 1000, &Topics::take_events, this, no_delay);
    imu_ = node.subscribe("imu", 5000, &Topics::take_imu, this, no_delay);
  }

 private:
  void take_events(const topic_tools::ShapeShifter::ConstPtr& message) {
    bytes_.resize(message->size());
    ros::serialization::OStream stream(bytes_.data(), message->size());
    message->write(stream);
    const std::string fault = engine_.add_events(message->getDataType(), message->getMD5Sum(),
                                                 reinterpret_cast<const std::byte*>(bytes_.data()), bytes_.size());
    if (!fault.empty()) ROS_WARN_STREAM_THROTTLE(1, fault);
  }
  void take_imu(const sensor_msgs::Imu::ConstPtr& m) {
    const auto &w = m->angular_velocity, &a = m->linear_acceleration;
    engine_.add_imu(static_cast<std::int64_t>(m->header.stamp.toNSec()), {w.x, w.y, w.z}, {a.x, a.y, a.z});
  }

  Engine& engine_;
  ros::Subscriber events_, imu_;
  std::vector<std::uint8_t> bytes_;
};

template <class To>
void set(To& to, const std::array<double, 3>& from) {
  to.x = from[0], to.y = from[1], to.z = from[2];
}

/// What is published of each update.
class Publisher {
 public:
  Publisher(ros::NodeHandle& node, std::string map_frame, std::string base_frame)
      : map_frame_(std::move(map_frame)), base_frame_(std::move(base_frame)) {
    odometry_ = node.advertise<nav_msgs::Odometry>("odom", 100);
    path_ = node.advertise<nav_msgs::Path>("path", 1, true);
    map_ = node.advertise<sensor_msgs::PointCloud2>("map", 1, true);
    diagnostics_ = node.advertise<diagnostic_msgs::DiagnosticArray>("/diagnostics", 10);
    path_message_.header.frame_id = map_frame_;
  }

  void add(const PoseMessage& pose) {
    nav_msgs::Odometry m;
    m.header.stamp.fromNSec(static_cast<std::uint64_t>(std::max<std::int64_t>(pose.t_ns, 0)));
    m.header.frame_id = map_frame_;
    m.child_frame_id = base_frame_;
    set(m.pose.pose.position, pose.position);
    auto& q = m.pose.pose.orientation;
    q.x = pose.orientation[0], q.y = pose.orientation[1], q.z = pose.orientation[2], q.w = pose.orientation[3];
    set(m.twist.twist.linear, pose.velocity);
    set(m.twist.twist.angular, pose.rates);
    std::copy(pose.covariance.begin(), pose.covariance.end(), m.pose.covariance.begin());
    for (std::size_t i = 0; i < 9; ++i) m.twist.covariance[i / 3 * 6 + i % 3] = pose.velocity_covariance[i];
    odometry_.publish(m);
    geometry_msgs::TransformStamped tf;
    tf.header = m.header;
    tf.child_frame_id = base_frame_;
    set(tf.transform.translation, pose.position);
    tf.transform.rotation = m.pose.pose.orientation;
    broadcaster_.sendTransform(tf);
    extend_path(m);
  }

  void publish_map(const std::vector<std::array<float, 3>>& points) {
    sensor_msgs::PointCloud2 m;
    m.header.frame_id = map_frame_;
    m.height = 1;
    m.width = static_cast<std::uint32_t>(points.size());
    const char* const names[] = {"x", "y", "z"};
    for (std::uint32_t i = 0; i < 3; ++i) {
      sensor_msgs::PointField field;
      field.name = names[i];
      field.offset = 4 * i;
      field.datatype = sensor_msgs::PointField::FLOAT32;
      field.count = 1;
      m.fields.push_back(field);
    }
    m.point_step = 12;
    m.row_step = 12 * m.width;
    m.is_dense = true;
    m.data.resize(m.row_step);
    if (!points.empty()) std::memcpy(m.data.data(), points.data(), m.data.size());
    map_.publish(m);
  }

  void diagnose(const Status& status) {
    const ros::WallTime now = ros::WallTime::now();
    if ((now - diagnosed_).toSec() < kDiagnostics_s) return;
    diagnosed_ = now;
    diagnostic_msgs::DiagnosticStatus m;
    m.name = "evpose";
    m.message = status.health + (status.reason.empty() ? "" : ": " + status.reason);
    m.level = status.health == "tracking" ? diagnostic_msgs::DiagnosticStatus::OK
              : status.health == "lost"   ? diagnostic_msgs::DiagnosticStatus::ERROR
                                          : diagnostic_msgs::DiagnosticStatus::WARN;
    const auto add = [&](const char* key, std::uint64_t value) {
      diagnostic_msgs::KeyValue pair;
      pair.key = key;
      pair.value = std::to_string(value);
      m.values.push_back(pair);
    };
    add("updates", status.updates);
    add("restarts", status.restarts);
    add("events", status.events);
    add("events shed", status.events_shed);
    diagnostic_msgs::DiagnosticArray message;
    message.header.stamp = ros::Time::now();
    message.status.push_back(m);
    diagnostics_.publish(message);
  }

 private:
  void extend_path(const nav_msgs::Odometry& odometry) {
    auto& poses = path_message_.poses;
    const double since = poses.empty() ? kPath_s : (odometry.header.stamp - poses.back().header.stamp).toSec();
    if (since >= 0 && since < kPath_s) return;
    if (since < 0) poses.clear();  // the clock went back
    if (poses.size() == kMostPath) poses.erase(poses.begin(), poses.begin() + kMostPath / 10);
    geometry_msgs::PoseStamped pose;
    pose.header = odometry.header;
    pose.pose = odometry.pose.pose;
    poses.push_back(pose);
    path_message_.header.stamp = odometry.header.stamp;
    path_.publish(path_message_);
  }

  std::string map_frame_, base_frame_;
  ros::Publisher odometry_, path_, map_, diagnostics_;
  tf2_ros::TransformBroadcaster broadcaster_;
  nav_msgs::Path path_message_;
  ros::WallTime diagnosed_;
};

int run() {
  ros::NodeHandle node, own("~");
  const auto text = [&](const char* name, const char* otherwise = "") { return own.param<std::string>(name, otherwise); };
  Parameters parameters{text("map"), text("calibration"), text("init"), text("imu_model"), text("occluders"), {}};
  own.getParam("settings", parameters.settings);
  Publisher publisher(node, text("map_frame", "map"), text("base_frame", "base_link"));
  std::string error;
  const auto engine = Engine::create(parameters,
                                     {[&](const PoseMessage& pose) { publisher.add(pose); },
                                      [](const std::string& words) { ROS_WARN_STREAM(words); }},
                                     error);
  if (!engine) return std::fprintf(stderr, "evpose: %s\n", error.c_str()), 2;
  publisher.publish_map(engine->map_points());
  const boost::function<bool(std_srvs::Empty::Request&, std_srvs::Empty::Response&)> ask =
      [&](std_srvs::Empty::Request&, std_srvs::Empty::Response&) {
        engine->reset();
        return true;
      };
  const auto service = own.advertiseService<std_srvs::Empty::Request, std_srvs::Empty::Response>("reset", ask);
  const Topics topics(node, *engine);
  ros::AsyncSpinner spinner(1);  // one thread: messages keep their order
  spinner.start();
  while (ros::ok()) {
    engine->work();
    publisher.diagnose(engine->status());
  }
  spinner.stop();
  return 0;
}

}  // namespace
}  // namespace evpose_ros

int main(int argc, char** argv) {
  ros::init(argc, argv, "evpose");
  if (!ros::master::check()) {
    std::fprintf(stderr, "evpose: no ROS master at %s; start roscore, or set ROS_MASTER_URI\n",
                 ros::master::getURI().c_str());
    return 2;
  }
  return evpose_ros::run();
}
