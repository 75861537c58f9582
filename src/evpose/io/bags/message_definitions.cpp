// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/io/bags/message_definitions.h"

#include <algorithm>
#include <array>
#include <vector>

#include "evpose/core/error.h"

namespace evpose {
namespace {

struct Definition {
  std::string_view type, md5, fields;
};

// Of types that are only parts of others, or only written as ROS 2 has them, no MD5 is needed.
constexpr std::array<Definition, 21> kDefinitions = {{
    {"builtin_interfaces/Time", "", "int32 sec\nuint32 nanosec\n"},
    {"std_msgs/Header", "", "uint32 seq\ntime stamp\nstring frame_id\n"},
    {"geometry_msgs/Vector3", "", "float64 x\nfloat64 y\nfloat64 z\n"},
    {"geometry_msgs/Point", "", "float64 x\nfloat64 y\nfloat64 z\n"},
    {"geometry_msgs/Quaternion", "", "float64 x\nfloat64 y\nfloat64 z\nfloat64 w\n"},
    {"geometry_msgs/Pose", "", "geometry_msgs/Point position\ngeometry_msgs/Quaternion orientation\n"},
    {"dvs_msgs/Event", "", "uint16 x\nuint16 y\ntime ts\nbool polarity\n"},
    {"dvs_msgs/EventArray", "5e8beee5a6c107e504c2e78903c224b8",
     "std_msgs/Header header\nuint32 height\nuint32 width\ndvs_msgs/Event[] events\n"},
    {"event_camera_msgs/EventPacket", "8a6101b351a64529ac77bd8b71074e52",
     "std_msgs/Header header\nuint32 height\nuint32 width\nuint64 seq\nuint64 time_base\nstring encoding\n"
     "bool is_bigendian\nuint8[] events\n"},
    {"sensor_msgs/Imu", "6a62c6daae103f4ff57a132d6f95cec2",
     "std_msgs/Header header\ngeometry_msgs/Quaternion orientation\nfloat64[9] orientation_covariance\n"
     "geometry_msgs/Vector3 angular_velocity\nfloat64[9] angular_velocity_covariance\n"
     "geometry_msgs/Vector3 linear_acceleration\nfloat64[9] linear_acceleration_covariance\n"},
    {"geometry_msgs/PoseStamped", "d3812c3cbc69362b77dc0b19b345f8f5",
     "std_msgs/Header header\ngeometry_msgs/Pose pose\n"},
    {"geometry_msgs/PoseWithCovariance", "", "geometry_msgs/Pose pose\nfloat64[36] covariance\n"},
    {"geometry_msgs/PoseWithCovarianceStamped", "",
     "std_msgs/Header header\ngeometry_msgs/PoseWithCovariance pose\n"},
    {"geometry_msgs/Transform", "", "geometry_msgs/Vector3 translation\ngeometry_msgs/Quaternion rotation\n"},
    {"geometry_msgs/TransformStamped", "",
     "std_msgs/Header header\nstring child_frame_id\ngeometry_msgs/Transform transform\n"},
    {"tf2_msgs/TFMessage", "", "geometry_msgs/TransformStamped[] transforms\n"},
    {"nav_msgs/Path", "", "std_msgs/Header header\ngeometry_msgs/PoseStamped[] poses\n"},
    {"sensor_msgs/PointField", "", "string name\nuint32 offset\nuint8 datatype\nuint32 count\n"},
    {"sensor_msgs/PointCloud2", "",
     "std_msgs/Header header\nuint32 height\nuint32 width\nsensor_msgs/PointField[] fields\n"
     "bool is_bigendian\nuint32 point_step\nuint32 row_step\nuint8[] data\nbool is_dense\n"},
    {"sensor_msgs/CompressedImage", "", "std_msgs/Header header\nstring format\nuint8[] data\n"},
    {"evpose_msgs/Health", "",
     "std_msgs/Header header\nuint8 level\nstring state\nstring reason\nfloat64 position_sigma_m\n"
     "float64 rotation_sigma_deg\nfloat64 speed_m_s\nuint32 points\nuint32 points_matched\n"},
}};

const Definition& find(std::string_view type) {
  const auto* const it = std::find_if(kDefinitions.begin(), kDefinitions.end(),
                                      [&](const Definition& d) { return d.type == type; });
  EVPOSE_CHECK(it != kDefinitions.end());
  return *it;
}

/// Fields as the language has them: in ROS 2 headers are not numbered and time is a message.
std::string fields_of(const Definition& definition, Wire wire) {
  std::string out(definition.fields);
  if (wire != Wire::cdr) return out;
  if (const auto at = out.find("uint32 seq\n"); definition.type == "std_msgs/Header") out.erase(at, 11);
  for (const std::string_view field : {"time stamp", "time ts"})
    if (const auto at = out.find(field); at != std::string::npos)
      out.replace(at, 4, "builtin_interfaces/Time");
  return out;
}

/// Types that the fields name, each once, in order, with those that they name.
void collect(std::string_view fields, Wire wire, std::vector<std::string_view>& types) {
  for (const Definition& definition : kDefinitions) {
    const auto at = fields.find(definition.type);
    const std::size_t end = at + definition.type.size();
    const bool named = at != std::string_view::npos && (at == 0 || fields[at - 1] == '\n') &&
                       (fields[end] == ' ' || fields[end] == '[');
    if (!named || std::find(types.begin(), types.end(), definition.type) != types.end()) continue;
    types.push_back(definition.type);
    collect(fields_of(definition, wire), wire, types);
  }
}

}  // namespace

std::string message_definition(std::string_view type, Wire wire) {
  std::string out = fields_of(find(type), wire);
  std::vector<std::string_view> parts;
  collect(out, wire, parts);
  for (const std::string_view part : parts)
    out += std::string(80, '=') + text("\nMSG: ", part, "\n") + fields_of(find(part), wire);
  return out;
}

std::string_view message_md5(std::string_view type) { return find(type).md5; }

}  // namespace evpose
