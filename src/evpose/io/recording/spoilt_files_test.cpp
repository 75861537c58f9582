// SPDX-License-Identifier: BSD-3-Clause
// Files spoilt at random, in every format: a value or one line, never a crash.
#include <gtest/gtest.h>

#include <algorithm>
#include <random>

#include "evpose/core/log.h"
#include "evpose/io/calibration/calibration.h"
#include "evpose/io/events/events_h5.h"
#include "evpose/io/files/test_files.h"
#include "evpose/io/formats/open_events.h"
#include "evpose/io/maps/contour_files.h"
#include "evpose/io/maps/map_h5.h"
#include "evpose/io/maps/ply.h"
#include "evpose/io/motion/imu_csv.h"
#include "evpose/io/motion/trajectory_tum.h"
#include "evpose/io/recording/recording_yaml.h"

// The HDF5 library itself forgets memory when it gives up on a damaged file.
extern "C" const char*
__lsan_default_suppressions();  // NOLINT(bugprone-reserved-identifier): the sanitizer's name
extern "C" const char* __lsan_default_suppressions() {
  return "leak:libhdf5";
}  // NOLINT(bugprone-reserved-identifier)

namespace evpose {
namespace {

class Spoiler {
 public:
  explicit Spoiler(unsigned seed) : random_(seed) {}

  /// A few bytes changed, taken out, put in or doubled.
  std::string spoilt(std::string s) {
    for (int n = 1 + below(3); n > 0 && !s.empty(); --n) {
      const auto at = static_cast<std::size_t>(below(static_cast<int>(s.size())));
      const auto length = std::min<std::size_t>(static_cast<std::size_t>(1 + below(8)), s.size() - at);
      switch (below(5)) {
        case 0:
          s[at] = static_cast<char>(below(256));
          break;
        case 1:
          s[at] = "0123456789-.e+ \n,[]:{}#nan"[below(26)];
          break;
        case 2:
          s.erase(at, length);
          break;
        case 3:
          s.insert(at, s.substr(at, length));
          break;
        default:
          s.insert(at, std::string(length, static_cast<char>(below(256))));
          break;
      }
    }
    return s;
  }

 private:
  int below(int n) { return static_cast<int>(random_() % static_cast<unsigned>(n)); }

  std::mt19937 random_;
};

/// Reads `rounds` spoilt versions of a file that is sound.
template <class Read>
void spoil(const std::string& name, const std::string& content, int rounds, const Read& read) {
  const TemporaryFolder folder;
  Spoiler spoiler(static_cast<unsigned>(content.size()));
  const std::string sound = folder.file(name, content);
  const auto unspoilt = read(sound);
  ASSERT_TRUE(unspoilt.ok()) << name << ": " << error_line(unspoilt);
  set_log_level(LogLevel::quiet);
  for (int i = 0; i < rounds; ++i) {
    const std::string path = folder.file(name, spoiler.spoilt(content));
    const auto result = read(path);
    expect_no_harm(result, path, static_cast<std::size_t>(i));
    EXPECT_EQ(error_line(result).find('\n'), std::string::npos);
  }
  set_log_level(LogLevel::normal);
}

Expected<std::size_t> count_events(const std::string& path) {
  auto reader = open_events(path, "", {});
  if (!reader) return reader.error();
  std::size_t events = 0;
  EventPacket packet;
  while (true) {
    const auto more = (*reader)->next(packet);
    if (!more) return more.error();
    if (!*more) return events;
    events += packet.events.size();
  }
}

ContourMap line_of_points() {
  ContourMap map;
  for (int i = 0; i < 6; ++i) {
    ContourPoint p;
    p.position = {0.01F * static_cast<float>(i), 0, 0};
    p.normal = {0, 0, 1};
    p.contour = i < 3 ? 0 : -1;
    map.points.push_back(p);
  }
  map.occluders.vertices = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
  map.occluders.triangles = {{0, 1, 2}};
  return map;
}

TEST(SpoiltFiles, Events) {
  spoil("a.txt", "0.000000000 30 134 0\n0.000779999 158 59 0\n0.001706 84 25 1\n", 200, count_events);
  spoil("a.csv", "%geometry:640,480\n3,4,1,1500\n5,6,0,1501\n", 200, count_events);
  const TemporaryFolder folder;
  auto writer = EventWriterH5::create(folder / "a.h5", {64, 48}, "sensor");
  EventPacket packet;
  for (std::uint32_t i = 0; i < 20; ++i) packet.events.push_back(make_event(i, static_cast<int>(i), 2, true));
  ASSERT_TRUE(writer->append(packet).ok() && writer->finish().ok());
  spoil("b.h5", content_of(folder / "a.h5"), 200, count_events);
}

TEST(SpoiltFiles, Tables) {
  spoil("imu.csv", "#timestamp_ns,wx,wy,wz,ax,ay,az\n0,1,2,3,4,5,6\n1000,1,2,3,4,5,6\n2000,1,2,3,4,5,6\n",
        200, [](const std::string& path) { return read_imu_csv(path); });
  spoil("a.tum", "# t\n1.5 1 2 3 0 0 0 1\n2.5 1 2 3 0.5 0.5 0.5 0.5\n", 200, read_tum);
}

TEST(SpoiltFiles, Yaml) {
  spoil("c.yaml",
        "cam0:\n  camera_model: pinhole\n  distortion_model: radtan\n  distortion_coeffs: [0.1, 0.2, 0, 0]\n"
        "  intrinsics: [100, 100, 50, 40]\n  resolution: [100, 80]\n"
        "  T_cam_imu: [[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]]\n",
        200, [](const std::string& path) { return read_calibration(path); });
  spoil("recording.yaml",
        "version: 1\nfiles: {events: a.h5}\nevents: {flip_x: true, resolution: [6, 4]}\nimu: {columns: [a, "
        "b]}\n"
        "initial_pose: {t_ns: 7, p: [1, 2, 3], q_xyzw: [0, 0, 0, 1]}\ntime: {t_start_s: 0.5}\n",
        200, read_recording_yaml);
}

TEST(SpoiltFiles, Maps) {
  const auto read = [](const std::string& path) { return read_contour_map(path); };
  const TemporaryFolder folder;
  ASSERT_TRUE(write_ply_contours(folder / "a.ply", line_of_points()).ok());
  spoil("b.ply", content_of(folder / "a.ply"), 200, read);
  ASSERT_TRUE(write_map_h5(folder / "a.h5", line_of_points()).ok());
  spoil("b.h5", content_of(folder / "a.h5"), 200, read);
  ASSERT_TRUE(write_ply_mesh(folder / "c.ply", line_of_points().occluders, Eigen::Vector3d::Zero()).ok());
  spoil("d.ply", content_of(folder / "c.ply"), 200,
        [](const std::string& path) { return read_ply_mesh(path, Eigen::Vector3d::Zero()); });
  const std::string pcd =
      "VERSION .7\nFIELDS x y z n\nSIZE 4 4 4 2\nTYPE F F F I\nCOUNT 1 1 1 2\nWIDTH 4\nHEIGHT 1\n";
  spoil("a.pcd", pcd + "POINTS 4\nDATA ascii\n0 0 0 1 2\n0.1 0 0 1 2\n0.2 0 0 1 2\n0.3 0 0 1 2\n", 200, read);
  const std::string row("\0\0\x80\x3F\0\0\0\0\0\0\0\0\1\0\2\0", 16);
  std::string rows;
  for (char i = 0; i < 4; ++i) rows += row.substr(0, 1) + std::string(1, i) + row.substr(2);
  spoil("b.pcd", pcd + "POINTS 4\nDATA binary\n" + rows, 200, read);
}

}  // namespace
}  // namespace evpose
