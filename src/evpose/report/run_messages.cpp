// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/report/run_messages.h"

#include <bit>
#include <map>
#include <memory>
#include <optional>

#include "evpose/io/bags/bag_container_writer.h"
#include "evpose/io/bags/message_writer.h"
#include "evpose/report/run_pictures.h"
#include "evpose/report/series.h"

namespace evpose {
namespace {

constexpr const char* kMap = "map";
constexpr const char* kBody = "body";
constexpr TimeNs kPictureEvery = 100 * kNsPerMs;
constexpr std::size_t kMostPathPoses = 5000, kMostMapPoints = 300'000;
constexpr std::uint8_t kFloat32 = 7;  // of sensor_msgs/PointField

/// Messages of one topic after another into one file.
class RunWriter {
 public:
  explicit RunWriter(std::unique_ptr<BagContainerWriter> file) : file_(std::move(file)) {}

  void put_map(TimeNs t, const ContourMap& map, RunMessages* counts);
  void put_path(const std::vector<RunRow>& rows);
  void put_pose(const RunRow& row);
  void put_health(const RunRow& row);
  void put_picture(TimeNs t, const RgbImage& image);
  Status finish() { return file_->finish(); }

 private:
  std::size_t topic(const char* name, const char* type);
  void begin(TimeNs t, const char* frame);
  void header(TimeNs t, const char* frame);
  void pose(const Pose& pose);

  std::unique_ptr<BagContainerWriter> file_;
  std::map<std::string, std::size_t> topics_;
  MessageWriter message_{Wire::cdr};
};

std::size_t RunWriter::topic(const char* name, const char* type) {
  const auto found = topics_.find(name);
  return found != topics_.end() ? found->second
                                : topics_.emplace(name, file_->add_topic(name, type)).first->second;
}

void RunWriter::header(TimeNs t, const char* frame) {
  message_.time(t);
  message_.string(frame);
}

void RunWriter::begin(TimeNs t, const char* frame) {
  message_.clear();
  header(t, frame);
}

void RunWriter::pose(const Pose& pose) {
  message_.numbers({pose.p.data(), 3});
  message_.numbers({pose.q.coeffs().data(), 4});  // x y z w
}

void RunWriter::put_map(TimeNs t, const ContourMap& map, RunMessages* counts) {
  std::vector<float> xyz;
  for (const std::size_t i : evenly_spaced_indices(map.points.size(), kMostMapPoints)) {
    const Eigen::Vector3f p = map.position(i).cast<float>();
    xyz.insert(xyz.end(), {p.x(), p.y(), p.z()});
  }
  const auto count = static_cast<std::uint32_t>(xyz.size() / 3);
  begin(t, kMap);
  message_.u32(1);
  message_.u32(count);
  message_.u32(3);
  for (const std::uint32_t axis : {0u, 1u, 2u}) {
    message_.string(std::string(1, static_cast<char>('x' + axis)));
    message_.u32(4 * axis);
    message_.u8(kFloat32);
    message_.u32(1);
  }
  message_.u8(std::endian::native == std::endian::big ? 1 : 0);
  message_.u32(12);
  message_.u32(12 * count);
  message_.byte_sequence(std::as_bytes(std::span(xyz)));
  message_.u8(1);  // dense
  file_->write(topic("/map", "sensor_msgs/PointCloud2"), t, message_.data());
  counts->map_points = count;
}

void RunWriter::put_path(const std::vector<RunRow>& rows) {
  std::vector<const RunRow*> valid;
  for (const RunRow& row : rows)
    if (row.valid()) valid.push_back(&row);
  const TimeNs t = rows.front().t;
  const auto chosen = evenly_spaced_indices(valid.size(), kMostPathPoses);
  begin(t, kMap);
  message_.u32(static_cast<std::uint32_t>(chosen.size()));
  for (const std::size_t i : chosen) {
    header(valid[i]->t, kMap);
    pose(valid[i]->T_map_body);
  }
  file_->write(topic("/trajectory", "nav_msgs/Path"), t, message_.data());
}

void RunWriter::put_pose(const RunRow& row) {
  begin(row.t, kMap);
  pose(row.T_map_body);
  Matrix6d turned = Matrix6d::Identity();  // ROS has rotations about the fixed axes
  turned.block<3, 3>(3, 3) = row.T_map_body.rotation();
  const Eigen::Matrix<double, 6, 6, Eigen::RowMajor> covariance =
      turned * row.covariance * turned.transpose();
  message_.numbers({covariance.data(), 36});
  file_->write(topic("/pose", "geometry_msgs/PoseWithCovarianceStamped"), row.t, message_.data());
  message_.clear();
  message_.u32(1);
  header(row.t, kMap);
  message_.string(kBody);
  pose(row.T_map_body);
  file_->write(topic("/tf", "tf2_msgs/TFMessage"), row.t, message_.data());
}

void RunWriter::put_health(const RunRow& row) {
  begin(row.t, kBody);
  message_.u8(static_cast<std::uint8_t>(row.health));
  message_.string(to_string(row.health));
  message_.string(row.reason);
  message_.f64(row.position_sigma_m());
  message_.f64(row.rotation_sigma_deg());
  message_.f64(row.velocity.norm());
  message_.u32(static_cast<std::uint32_t>(row.points));
  message_.u32(static_cast<std::uint32_t>(row.points_matched));
  file_->write(topic("/health", "evpose_msgs/Health"), row.t, message_.data());
}

void RunWriter::put_picture(TimeNs t, const RgbImage& image) {
  begin(t, "camera");
  message_.string("png");
  message_.byte_sequence(encode_png(image));
  file_->write(topic("/overlay", "sensor_msgs/CompressedImage"), t, message_.data());
}

Status check_times(const RunFiles& run) {
  for (const TimeNs t : {run.rows.front().t, run.rows.back().t})
    if (t < 0 || t >= message_time_end(Wire::cdr))
      return Error{run.folder,
                   text("a stamp of ", to_seconds(t), " s cannot be written: ROS counts from 1970 to 2038"),
                   "track again with time.offset_events_s and an IMU of such times"};
  return {};
}

Status put_updates(RunWriter& writer, const RunFiles& run, std::optional<RunPictures>& pictures,
                   RunMessages* counts) {
  TimeNs next = run.rows.front().t;
  for (const RunRow& row : run.rows) {
    if (row.valid()) writer.put_pose(row), ++counts->poses;
    writer.put_health(row);
    if (!pictures || row.t < next) continue;
    next = row.t + kPictureEvery;
    const auto image = pictures->draw(row);
    if (!image) return image.error();
    writer.put_picture(row.t, *image);
    ++counts->pictures;
  }
  return {};
}

}  // namespace

Expected<RunMessages> write_run_mcap(const std::string& path, const RunFiles& run) {
  if (auto status = check_times(run); !status) return status.error();
  RunMessages counts;
  std::optional<RunPictures> pictures;
  const auto map = read_run_map(run);
  if (auto opened = map ? RunPictures::open(run, *map) : map.error())
    pictures.emplace(*std::move(opened));
  else
    counts.without = opened.error().line();
  auto file = create_mcap(path, Compression::none);  // pictures, most of it, are packed already
  if (!file) return file.error();
  RunWriter writer(*std::move(file));
  if (map) writer.put_map(run.rows.front().t, *map, &counts);
  writer.put_path(run.rows);
  if (auto status = put_updates(writer, run, pictures, &counts); !status) return status.error();
  if (auto status = writer.finish(); !status) return status.error();
  return counts;
}

}  // namespace evpose
