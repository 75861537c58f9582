// SPDX-License-Identifier: BSD-3-Clause
// Writes bags of known content for other programs to read, or compares what two bags hold:
// make_bags FOLDER | make_bags ONE OTHER
#include <cstdio>
#include <string>

#include "evpose/io/bags/bag_writer.h"
#include "evpose/io/formats/open_events.h"

namespace evpose {
namespace {

constexpr TimeNs kStart = 1'700'000'000'000'000'000;
constexpr int kPackets = 300, kEventsInPacket = 1000;

// The readers compute the same by their own code.
ImuSample imu_sample(int i) {
  return {kStart + i * 5'000'001LL, {0.5 * i, -0.25, 0.125}, {i / 8.0, 2, -9.75}};
}

TimedPose timed_pose(int i) {
  const Eigen::Quaterniond q =
      i % 2 == 0 ? Eigen::Quaterniond(1, 0, 0, 0) : Eigen::Quaterniond(0.5, -0.5, 0.5, -0.5);
  return {kStart + i * 7'000'003LL, {q, {i / 4.0, -2, 3}}};
}

EventPacket event_packet(int k) {
  EventPacket out;
  out.base = kStart + k * kEventsInPacket * 13 * kNsPerUs;
  for (int i = 0; i < kEventsInPacket; ++i) {
    const int n = k * kEventsInPacket + i;
    out.events.push_back(
        make_event(static_cast<std::uint32_t>(i * 13), n * 7 % 640, n * 11 % 480, n % 3 == 0));
  }
  return out;
}

Status write_bag(const std::string& path, const BagWriteOptions& options) {
  auto writer = BagWriter::create(path, {640, 480}, options);
  if (!writer) return writer.error();
  for (int k = 0; k < kPackets; ++k) {
    for (const Status& status :
         {writer->append(event_packet(k)), writer->append(imu_sample(k)), writer->append(timed_pose(k))})
      if (!status) return status;
  }
  return writer->finish();
}

int run(const std::string& folder) {
  const struct {
    const char* name;
    Compression compression;
    bool packets;
  } bags[] = {{"plain.bag", Compression::none, false},
              {"lz4.bag", Compression::lz4, false},
              {"packets.bag", Compression::lz4, true},
              {"plain.mcap", Compression::none, false},
              {"packets.mcap", Compression::none, true}};
  for (const auto& bag : bags) {
    BagWriteOptions options;
    options.compression = bag.compression;
    options.event_packets = bag.packets;
    if (const Status status = write_bag(folder + "/" + bag.name, options); !status) {
      std::fprintf(stderr, "%s\n", status.error().line().c_str());
      return 2;
    }
  }
  return 0;
}

/// All that a bag holds, as text; stream by stream, as their order among each other may differ.
Expected<std::string> content_of(const std::string& path) {
  std::string out, poses;
  SensorSink sink;
  sink.imu = [&](const ImuSample& s) {
    out += text("imu ", s.t, " ", s.gyro.transpose(), " ", s.accel.transpose(), "\n");
  };
  sink.pose = [&](const TimedPose& p) {
    poses += text("pose ", p.t, " ", p.pose.p.transpose(), " ", p.pose.q.coeffs().transpose(), "\n");
  };
  if (const Status status = read_sensors(path, "", sink); !status) return status.error();
  out += poses;
  auto reader = open_events(path, "", {});
  if (!reader) return reader.error();
  EventPacket packet;
  while (true) {
    const auto more = (*reader)->next(packet);
    if (!more) return more.error();
    if (!*more) return out;
    for (const Event& e : packet.events) out += text(packet.time(e), " ", e.x, " ", e.y, " ", e.on, "\n");
  }
}

int compare(const std::string& one, const std::string& other) {
  const auto a = content_of(one), b = content_of(other);
  for (const auto& content : {a, b}) {
    if (content) continue;
    std::fprintf(stderr, "%s\n", content.error().line().c_str());
    return 2;
  }
  return *a == *b && !a->empty() ? 0 : 1;
}

}  // namespace
}  // namespace evpose

int main(int count, char** arguments) {
  if (count == 3) return evpose::compare(arguments[1], arguments[2]);
  return count == 2 ? evpose::run(arguments[1]) : 2;
}
