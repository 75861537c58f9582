// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/io/motion/trajectory.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <string_view>

#include "evpose/core/log.h"
#include "evpose/io/bags/bag_reader.h"
#include "evpose/io/bags/bag_streams.h"
#include "evpose/io/files/atomic_file.h"
#include "evpose/io/files/numbers.h"
#include "evpose/io/files/row_reader.h"
#include "evpose/io/motion/trajectory_rows.h"
#include "evpose/io/motion/trajectory_tum.h"

namespace evpose {
namespace {

constexpr std::size_t kSampleRows = 200;
constexpr std::size_t kMatrixColumns = 12;
constexpr std::size_t kMostCsvColumns = 17;
/// No trajectory has a pose a minute: larger steps are microseconds.
constexpr double kLongestStep = 60;
const std::string kKittiRow = "a row is the 12 numbers of a 3x4 matrix, row by row";

/// What the first lines of a file look like.
struct Look {
  std::size_t columns = 0;
  bool commas = false;
  bool fractions = false;      ///< some stamp is written with a point: they are seconds
  bool scalar_last = false;    ///< a heading says so: `..., qx, qy, qz, qw`
  std::vector<double> stamps;  ///< first column

  double step() const {
    std::vector<double> steps;
    for (std::size_t i = 1; i < stamps.size(); ++i) steps.push_back(stamps[i] - stamps[i - 1]);
    if (steps.empty()) return 0;
    const auto middle = steps.begin() + static_cast<std::ptrdiff_t>(steps.size() / 2);
    std::nth_element(steps.begin(), middle, steps.end());
    return *middle;
  }
};

/// Where a heading names a part of the quaternion, such as `qw`, `q_w` or `q_RS_w []`; -1: nowhere.
int column_of(const std::vector<std::string_view>& heading, char part) {
  for (std::size_t i = 0; i < heading.size(); ++i) {
    const std::string_view name = trimmed(heading[i].substr(0, heading[i].find('[')));
    if (name.size() >= 2 && name.front() == 'q' && name.back() == part) return static_cast<int>(i);
  }
  return -1;
}

Expected<Look> look_at(const std::string& path) {
  auto rows = RowReader::open(path);
  if (!rows) return rows.error();
  Look out;
  std::vector<std::string_view> heading;
  while (out.stamps.size() < kSampleRows) {
    const auto more = rows->next();
    if (!more) return more.error();
    if (!*more) break;
    for (const std::string& comment : rows->comments()) {
      split_fields(comment, heading);
      const int x = column_of(heading, 'x'), w = column_of(heading, 'w');
      if (x >= 0 && w >= 0) out.scalar_last = x < w;
    }
    const auto& fields = rows->fields();
    double stamp = 0;
    if (!parse_number(fields.front(), stamp)) break;  // told of when it is read
    if (out.columns == 0) out.columns = fields.size();
    out.fractions = out.fractions || fields.front().find('.') != std::string_view::npos;
    out.commas = out.commas || rows->line().find(',') != std::string_view::npos;
    out.stamps.push_back(stamp);
  }
  return out;
}

Expected<std::vector<TimedPose>> read_bag_poses(const std::string& path) {
  std::vector<TimedPose> out;
  Status order;
  SensorSink sink;
  sink.pose = [&](const TimedPose& pose) {
    if (!out.empty() && pose.t <= out.back().t && order.ok()) order = not_after(path, pose.t, out.back().t);
    out.push_back(pose);
  };
  if (auto status = read_bag_sensors(path, "", sink); !status) return status.error();
  if (!order) return order.error();
  if (out.empty())
    return Error{path, "has no poses", "needed is a topic of geometry_msgs/PoseStamped or the like"};
  return out;
}

Expected<Pose> parse_matrix(const RowReader& rows) {
  const std::string where = rows.where();
  if (rows.fields().size() != kMatrixColumns)
    return Error{where, text(rows.fields().size(), " values instead of ", kMatrixColumns), kKittiRow};
  std::array<double, kMatrixColumns> values{};
  if (auto status = rows.numbers(0, values, kKittiRow); !status) return status.error();
  Eigen::Matrix4d matrix = Eigen::Matrix4d::Identity();
  matrix.topRows<3>() = Eigen::Map<const Eigen::Matrix<double, 3, 4, Eigen::RowMajor>>(values.data());
  const Eigen::Matrix3d R = matrix.topLeftCorner<3, 3>();
  if (!((R * R.transpose() - Eigen::Matrix3d::Identity()).norm() < 1e-2) || R.determinant() < 0)
    return Error{where, "its first three columns are no rotation", kKittiRow};
  return Pose::from_matrix(matrix);
}

Expected<std::vector<TimeNs>> read_times(const std::string& path) {
  auto rows = RowReader::open(path);
  if (!rows) return rows.error();
  std::vector<TimeNs> out;
  while (true) {
    const auto more = rows->next();
    if (!more) return more.error();
    if (!*more) return out;
    TimeNs t = 0;
    if (!parse_decimal(rows->line(), 9, t) || t > kLargestTimeNs || t < -kLargestTimeNs)
      return Error{rows->where(), text("'", rows->line(), "' is not a time in seconds"),
                   "a line is one stamp"};
    if (!out.empty() && t <= out.back()) return not_after(rows->where(), t, out.back());
    out.push_back(t);
  }
}

Expected<std::string> find_times(const std::string& path) {
  const std::filesystem::path poses(path);
  const auto beside = poses.parent_path() / "times.txt";
  const auto named = poses.parent_path() / (poses.stem().string() + "_times.txt");
  for (const auto& candidate : {named, beside})
    if (std::filesystem::is_regular_file(candidate)) return candidate.string();
  return Error{path, "holds poses without stamps", "put their times.txt, seconds, beside it"};
}

}  // namespace

Expected<std::vector<TimedPose>> read_euroc(const std::string& path) {
  return read_pose_rows(path, {.row = "a row is `t,px,py,pz,qw,qx,qy,qz`, t in ns",
                               .unit = "nanoseconds",
                               .time_decimals = 0,
                               .w_first = true,
                               .most_columns = kMostCsvColumns});
}

Expected<std::vector<TimedPose>> read_kitti(const std::string& path, const std::string& times) {
  auto rows = RowReader::open(path);
  if (!rows) return rows.error();
  const auto times_path = times.empty() ? find_times(path) : Expected<std::string>(times);
  if (!times_path) return times_path.error();
  const auto stamps = read_times(*times_path);
  if (!stamps) return stamps.error();
  std::vector<TimedPose> out;
  while (true) {
    const auto more = rows->next();
    if (!more) return more.error();
    if (!*more) break;
    const auto pose = parse_matrix(*rows);
    if (!pose) return pose.error();
    if (out.size() < stamps->size())
      out.push_back({(*stamps)[out.size()], *pose});
    else
      return Error{rows->where(), text("a pose more than the ", stamps->size(), " stamps of ", *times_path),
                   "both need the same number of lines"};
  }
  if (out.size() != stamps->size() || out.empty())
    return Error{path,
                 text("holds ", out.size(), " poses, but ", *times_path, " has ", stamps->size(), " stamps"),
                 "both need the same number of lines"};
  return out;
}

Expected<std::vector<TimedPose>> read_trajectory(const std::string& path) {
  if (is_bag(path)) return read_bag_poses(path);
  const auto look = look_at(path);
  if (!look) return look.error();
  if (look->columns == kMatrixColumns && !look->commas) return read_kitti(path);
  if (look->commas && look->fractions) {
    log_detail(path + ": stamps are read as seconds, the quaternion as x, y, z, w");
    return read_pose_rows(
        path, {.row = "a row is `t,px,py,pz,qx,qy,qz,qw`, t in s", .most_columns = kMostCsvColumns});
  }
  if (look->commas && look->scalar_last)
    return read_pose_rows(path, {.row = "a row is `t,px,py,pz,qx,qy,qz,qw`, t in ns",
                                 .unit = "nanoseconds",
                                 .time_decimals = 0,
                                 .most_columns = kMostCsvColumns});
  if (look->commas) return read_euroc(path);
  if (look->columns == 8 && look->step() > kLongestStep) {
    log_detail(path + ": stamps are read as microseconds");
    return read_pose_rows(
        path,
        {.row = "a row is `t tx ty tz qx qy qz qw`, t in us", .unit = "microseconds", .time_decimals = 3});
  }
  return read_tum(path);
}

Status write_euroc(const std::string& path, const std::vector<TimedPose>& trajectory) {
  auto file = AtomicFile::create(path);
  if (!file) return file.error();
  file->write(
      "#timestamp [ns],p_RS_R_x [m],p_RS_R_y [m],p_RS_R_z [m],q_RS_w [],q_RS_x [],q_RS_y [],q_RS_z []\n");
  for (const TimedPose& row : trajectory) {
    EVPOSE_CHECK(row.pose.p.allFinite() && row.pose.q.coeffs().allFinite());
    std::string line = std::to_string(row.t);
    for (int k = 0; k < 3; ++k) append_number(line, ',', row.pose.p[k], 9);
    const Eigen::Quaterniond& q = row.pose.q;
    for (const double value : {q.w(), q.x(), q.y(), q.z()}) append_number(line, ',', value, 10);
    file->write(line + "\n");
  }
  return file->commit();
}

}  // namespace evpose
