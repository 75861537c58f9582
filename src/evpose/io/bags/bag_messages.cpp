// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/io/bags/bag_messages.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "evpose/io/bags/event_messages.h"

namespace evpose {
namespace {

struct KnownType {
  std::string_view name, md5;  ///< empty md5: not compared
  StreamKind kind;
};
constexpr std::array<KnownType, 10> kTypes = {{
    {"dvs_msgs/EventArray", "5e8beee5a6c107e504c2e78903c224b8", StreamKind::events},
    {"prophesee_event_msgs/EventArray", "5e8beee5a6c107e504c2e78903c224b8", StreamKind::events},
    {"event_camera_msgs/EventPacket", "8a6101b351a64529ac77bd8b71074e52", StreamKind::events},
    {"event_array_msgs/EventArray", "", StreamKind::events},
    {"sensor_msgs/Imu", "6a62c6daae103f4ff57a132d6f95cec2", StreamKind::imu},
    {"sensor_msgs/Image", "060021388200f6f0f447d0fcd9c64743", StreamKind::frames},
    {"geometry_msgs/PoseStamped", "d3812c3cbc69362b77dc0b19b345f8f5", StreamKind::poses},
    {"geometry_msgs/PoseWithCovarianceStamped", "953b798c0f514ff060a53a3498ce6246", StreamKind::poses},
    {"geometry_msgs/TransformStamped", "b5764a33bfeb3588febc2682852579b0", StreamKind::poses},
    {"nav_msgs/Odometry", "cd5e73d190d741a2f92e81eda573aca7", StreamKind::poses},
}};

const KnownType* find_type(const BagTopic& topic) {
  const auto* const it =
      std::find_if(kTypes.begin(), kTypes.end(), [&](const KnownType& t) { return t.name == topic.type; });
  return it != kTypes.end() ? it : nullptr;
}

Error cut_off(const std::string& where, const BagTopic& topic) {
  return Error{where, "is no whole message of type " + topic.type, "is the bag damaged?"};
}

struct Header {
  TimeNs stamp = 0;
  std::string_view frame;
};

Header read_header(MessageReader& reader) {
  if (!reader.is_cdr()) reader.u32();  // seq
  Header out;
  out.stamp = reader.time();
  out.frame = reader.string();
  return out;
}

Eigen::Vector3d read_vector(MessageReader& reader) {
  const double x = reader.f64(), y = reader.f64(), z = reader.f64();
  return {x, y, z};
}

/// How an encoding of sensor_msgs/Image lies in memory.
struct PixelLayout {
  std::string_view name;
  int channels;  ///< stored
  int bytes;     ///< of one channel
  bool blue_first;
};
constexpr std::array<PixelLayout, 15> kPixels = {{{"mono8", 1, 1, false},
                                                  {"8UC1", 1, 1, false},
                                                  {"mono16", 1, 2, false},
                                                  {"16UC1", 1, 2, false},
                                                  {"rgb8", 3, 1, false},
                                                  {"bgr8", 3, 1, true},
                                                  {"8UC3", 3, 1, true},
                                                  {"rgba8", 4, 1, false},
                                                  {"bgra8", 4, 1, true},
                                                  {"rgb16", 3, 2, false},
                                                  {"bgr16", 3, 2, true},
                                                  {"bayer_rggb8", 1, 1, false},
                                                  {"bayer_bggr8", 1, 1, false},
                                                  {"bayer_gbrg8", 1, 1, false},
                                                  {"bayer_grbg8", 1, 1, false}}};

struct Picture {
  std::uint32_t width = 0, height = 0, step = 0;
  bool big_endian = false;
  std::span<const std::byte> data;
};

GreyFrame unpack(const Picture& picture, const PixelLayout& layout) {
  GreyFrame out;
  out.width = static_cast<int>(picture.width), out.height = static_cast<int>(picture.height);
  out.channels = std::min(layout.channels, 3);
  out.pixels.reserve(static_cast<std::size_t>(out.channels) * picture.width * picture.height);
  const auto bytes = static_cast<std::size_t>(layout.bytes);
  const std::size_t upper = layout.bytes == 2 && !picture.big_endian ? 1 : 0;  // the byte that is kept
  for (std::size_t y = 0; y < picture.height; ++y) {
    for (std::size_t x = 0; x < picture.width; ++x) {
      const std::byte* pixel =
          picture.data.data() + y * picture.step + x * bytes * static_cast<std::size_t>(layout.channels);
      for (int c = 0; c < out.channels; ++c) {
        const auto from = static_cast<std::size_t>(layout.blue_first ? out.channels - 1 - c : c);
        out.pixels.push_back(std::to_integer<std::uint8_t>(pixel[from * bytes + upper]));
      }
    }
  }
  return out;
}

}  // namespace

StreamKind kind_of_topic(const BagTopic& topic) {
  const KnownType* type = find_type(topic);
  return type != nullptr && topic.wire != Wire::other ? type->kind : StreamKind::other;
}

Status check_definition(const BagTopic& topic, const std::string& where) {
  const KnownType* type = find_type(topic);
  if (type == nullptr || type->md5.empty() || topic.md5.empty() || topic.md5 == "*" || topic.md5 == type->md5)
    return {};
  return Error{
      where,
      text("topic ", topic.name, " has ", topic.type, " with MD5 ", topic.md5, ", known is ", type->md5),
      "the message was changed: bring the bag to the known definition by `rosbag fix`"};
}

Expected<ImuSample> parse_imu(const BagTopic& topic, const BagMessage& message, const std::string& where) {
  MessageReader reader(message.data, topic.wire);
  ImuSample out;
  out.t = read_header(reader).stamp;
  constexpr int kOrientation = 4, kCovariance = 9;
  for (int k = 0; k < kOrientation + kCovariance; ++k) reader.f64();
  out.gyro = read_vector(reader);
  for (int k = 0; k < kCovariance; ++k) reader.f64();
  out.accel = read_vector(reader);
  for (int k = 0; k < kCovariance; ++k) reader.f64();
  if (!reader.ok()) return cut_off(where, topic);
  if (!out.gyro.allFinite() || !out.accel.allFinite())
    return Error{where, "an angular rate or acceleration is not a finite number", "remove the message"};
  return out;
}

Expected<TimedPose> parse_pose(const BagTopic& topic, const BagMessage& message, const std::string& where) {
  MessageReader reader(message.data, topic.wire);
  TimedPose out;
  out.t = read_header(reader).stamp;
  if (topic.type == "geometry_msgs/TransformStamped" || topic.type == "nav_msgs/Odometry")
    reader.string();  // child_frame_id
  out.pose.p = read_vector(reader);
  for (int k = 0; k < 4; ++k) out.pose.q.coeffs()[k] = reader.f64();
  if (!reader.ok()) return cut_off(where, topic);
  const double norm = out.pose.q.norm();
  if (!out.pose.p.allFinite() || !(std::abs(norm - 1) <= 1e-2))
    return Error{where,
                 text("is no pose: position ", out.pose.p.transpose(), ", norm of the quaternion ", norm),
                 "remove the message, or choose another topic"};
  out.pose.q.normalize();
  return out;
}

Expected<GreyFrame> parse_image(const BagTopic& topic, const BagMessage& message, const std::string& where) {
  MessageReader reader(message.data, topic.wire);
  const TimeNs stamp = read_header(reader).stamp;
  Picture picture;
  picture.height = reader.u32(), picture.width = reader.u32();
  const std::string_view encoding = reader.string();
  picture.big_endian = reader.u8() != 0;
  picture.step = reader.u32();
  picture.data = reader.byte_sequence();
  if (!reader.ok()) return cut_off(where, topic);
  const auto* const layout =
      std::find_if(kPixels.begin(), kPixels.end(), [&](const PixelLayout& p) { return p.name == encoding; });
  if (layout == kPixels.end())
    return Error{where, text("images encoded as '", encoding.substr(0, 20), "' cannot be read"),
                 "choose another topic, or convert them to mono8"};
  const std::uint64_t row =
      std::uint64_t{picture.width} * static_cast<unsigned>(layout->channels * layout->bytes);
  if (picture.width > 65536 || picture.height > 65536 || picture.step < row ||
      picture.data.size() < std::uint64_t{picture.step} * picture.height)
    return Error{where,
                 text("an image of ", picture.width, " x ", picture.height, " pixels in ",
                      picture.data.size(), " bytes"),
                 "is the bag damaged?"};
  GreyFrame out = unpack(picture, *layout);
  out.t = stamp;
  return out;
}

}  // namespace evpose
