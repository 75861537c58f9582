// SPDX-License-Identifier: BSD-3-Clause
#include <cstdio>
#include <filesystem>

#include "convert_parts.h"
#include "evpose/io/calibration/kalibr.h"
#include "evpose/io/files/atomic_file.h"
#include "evpose/io/files/numbers.h"
#include "evpose/io/files/png_file.h"
#include "evpose/io/formats/open_events.h"
#include "evpose/io/motion/trajectory.h"

namespace evpose {
namespace {

namespace fs = std::filesystem;

/// Grey levels of one channel or three.
std::vector<std::uint8_t> grey_of(const GreyFrame& frame) {
  if (frame.channels == 1) return frame.pixels;
  const auto channels = static_cast<std::size_t>(frame.channels);
  std::vector<std::uint8_t> out(frame.pixels.size() / channels);
  for (std::size_t i = 0; i < out.size(); ++i) {
    unsigned sum = 0;
    for (std::size_t c = 0; c < std::min<std::size_t>(3, channels); ++c)
      sum += frame.pixels[i * channels + c];
    out[i] = static_cast<std::uint8_t>(sum / std::min<std::size_t>(3, channels));
  }
  return out;
}

std::string numbered(std::size_t number) {
  const std::string digits = std::to_string(number);
  return std::string(6 - std::min<std::size_t>(6, digits.size()), '0') + digits + ".png";
}

Status copy(const std::string& from, const std::string& to) {
  std::error_code error;
  fs::copy_file(from, to, error);
  if (error) return Error{from, "cannot be copied: " + error.message(), "check the disk and the rights"};
  return {};
}

/// Of the frames as they come.
class FrameList {
 public:
  FrameList(const NewFolder& folder, const Crop& crop, TimeNs offset)
      : folder_(folder), crop_(crop), offset_(offset) {}

  bool holds(TimeNs t) const { return crop_.holds(t); }
  /// Where the next one belongs; makes the folder for the first one.
  Expected<std::string> next(TimeNs t, TimeNs exposure) {
    if (count_ == 0)
      if (auto made = folder_.make_folder("frames"); !made) return made.error();
    const std::string name = numbered(count_++);
    rows_ += text(t + offset_, ",", name, exposure > 0 ? "," + std::to_string(exposure) : "", "\n");
    return folder_.path("frames/" + name);
  }
  Expected<std::size_t> finish() const {
    if (count_ > 0)
      if (auto status = write_text_file(folder_.path("frames/timestamps.csv"),
                                        "#timestamp_ns,filename,exposure_ns\n" + rows_);
          !status)
        return status.error();
    return count_;
  }

 private:
  const NewFolder& folder_;
  Crop crop_;
  TimeNs offset_;
  std::string rows_;
  std::size_t count_ = 0;
};

/// Those that stand between the events of a file.
Status take_frames_of_file(const std::string& path, const ImageSize& size, FrameList& list) {
  Status failed;
  SensorSink sink;
  sink.frame = [&](const GreyFrame& frame) {
    if (!failed || !list.holds(frame.t)) return;
    if (ImageSize{frame.width, frame.height} != size) return;
    const auto place = list.next(frame.t, 0);
    failed = place ? write_png_grey8(*place, frame.width, frame.height, grey_of(frame)) : place.error();
  };
  if (auto status = read_sensors(path, "", sink); !status) return status;
  return failed;
}

std::string imu_rows(const std::vector<ImuSample>& imu) {
  std::string out =
      "#timestamp [ns],w_RS_S_x [rad s^-1],w_RS_S_y [rad s^-1],w_RS_S_z [rad s^-1],"
      "a_RS_S_x [m s^-2],a_RS_S_y [m s^-2],a_RS_S_z [m s^-2]\n";
  for (const ImuSample& s : imu) {
    std::string line = std::to_string(s.t);
    for (const Eigen::Vector3d* v : {&s.gyro, &s.accel})
      for (int k = 0; k < 3; ++k) append_number(line, ',', (*v)[k], 10);
    out += line + "\n";
  }
  return out;
}

/// What ORB-SLAM3 (its file version 1.0) knows of lenses. Error: another model.
Expected<std::string> orb_camera(const CameraIntrinsics& c, const std::string& where) {
  const bool fisheye = c.distortion_model == "equidistant";
  if (!fisheye && c.distortion_model != "radtan" && c.distortion_model != "none")
    return Error{where, "ORB-SLAM3 has no camera model " + c.distortion_model,
                 "calibrate with radtan or equidistant distortion"};
  std::string out = text("Camera.type: \"", fisheye ? "KannalaBrandt8" : "PinHole", "\"\nCamera1.fx: ", c.fx,
                         "\nCamera1.fy: ", c.fy, "\nCamera1.cx: ", c.cx, "\nCamera1.cy: ", c.cy, "\n");
  const std::vector<const char*> names = fisheye ? std::vector<const char*>{"k1", "k2", "k3", "k4"}
                                                 : std::vector<const char*>{"k1", "k2", "p1", "p2", "k3"};
  for (std::size_t i = 0; i < std::min(names.size(), c.distortion.size()); ++i)
    out += text("Camera1.", names[i], ": ", c.distortion[i], "\n");
  return out + text("Camera.width: ", c.size.width, "\nCamera.height: ", c.size.height, "\n");
}

double frame_rate_hz(const std::vector<FrameReader::Row>& rows) {
  if (rows.size() < 2) return 30;
  return static_cast<double>(rows.size() - 1) / to_seconds(rows.back().t - rows.front().t);
}

/// Settings of ORB-SLAM3, mono-inertial: the camera, its place and the IMU as calibrated, the rest as its
/// own file for EuRoC has it.
Expected<std::string> orb_settings(const Recording& r, double rate_hz) {
  const auto camera = orb_camera(r.camera, r.calibration_path);
  if (!camera) return camera.error();
  std::string place = "IMU.T_b_c1: !!opencv-matrix\n  rows: 4\n  cols: 4\n  dt: f\n  data: [";
  const Eigen::Matrix4d T_body_cam = r.T_cam_body.inverse().matrix();
  for (int i = 0; i < 16; ++i) place += text(i == 0 ? "" : ", ", T_body_cam(i / 4, i % 4));
  const ImuNoise& n = r.imu_noise;
  return text(
      "%YAML:1.0\n---\nFile.version: \"1.0\"\n", *camera, "Camera.fps: ", std::max(1L, std::lround(rate_hz)),
      "\nCamera.RGB: 1\n", place, "]\nIMU.NoiseGyro: ", n.gyro_density, "\nIMU.NoiseAcc: ", n.accel_density,
      "\nIMU.GyroWalk: ", n.gyro_walk, "\nIMU.AccWalk: ", n.accel_walk, "\nIMU.Frequency: ", n.rate_hz,
      ".0\nORBextractor.nFeatures: 1000\nORBextractor.scaleFactor: 1.2\nORBextractor.nLevels: 8\n"
      "ORBextractor.iniThFAST: 20\nORBextractor.minThFAST: 7\nViewer.KeyFrameSize: 0.05\n"
      "Viewer.KeyFrameLineWidth: 1.0\nViewer.GraphLineWidth: 0.9\nViewer.PointSize: 2.0\n"
      "Viewer.CameraSize: 0.08\nViewer.CameraLineWidth: 3.0\nViewer.ViewpointX: 0.0\n"
      "Viewer.ViewpointY: -0.7\nViewer.ViewpointZ: -3.5\nViewer.ViewpointF: 500.0\n");
}

/// The pictures by their stamps, and the lists of these.
Status write_pictures(const NewFolder& folder, const std::vector<FrameReader::Row>& rows, TimeNs offset) {
  std::string list = "#timestamp [ns],filename\n", times;
  for (const FrameReader::Row& row : rows) {
    const std::string stamp = std::to_string(row.t + offset), name = stamp + ".png";
    list += stamp + "," + name + (row.exposure > 0 ? "," + std::to_string(row.exposure) : "") + "\n";
    times += stamp + "\n";
    if (auto status = copy(row.path, folder.path("mav0/cam0/data/" + name)); !status) return status;
  }
  if (auto status = write_text_file(folder.path("mav0/cam0/data.csv"), list); !status) return status;
  return write_text_file(folder.path("times.txt"), times);
}

}  // namespace

Expected<std::size_t> write_frames(const NewFolder& folder, const ConvertRequest& request,
                                   const std::optional<Recording>& recording, ImageSize size,
                                   const Crop& crop) {
  FrameList list(folder, crop, from_seconds(request.offset_s));
  if (recording && !recording->frames_path.empty()) {
    const auto reader = open_frames(*recording);
    if (!reader) return reader.error();
    for (const FrameReader::Row& row : reader->rows()) {
      if (!list.holds(row.t)) continue;
      const auto place = list.next(row.t, row.exposure);
      if (!place) return place.error();
      if (auto status = copy(row.path, *place); !status) return status.error();
    }
    return list.finish();
  }
  const std::string path = recording ? recording->events_path : request.input;
  if (path.ends_with(".h5") || path.ends_with(".hdf5")) return 0;
  if (auto status = take_frames_of_file(path, size, list); !status) return status.error();
  return list.finish();
}

Expected<int> convert_to_euroc(const ConvertRequest& request) {
  const auto recording = open_recording(request.input, request.calibration);
  if (!recording) return recording.error();
  const Recording& r = *recording;
  if (r.frames_path.empty() || !r.has_imu)
    return Error{
        r.folder,
        text("has no ", r.frames_path.empty() ? "frames" : "IMU", ", which EuRoC's layout is made of"),
        "convert a bag or AEDAT4 file with frames to a recording folder first, or record them"};
  const auto frames = open_frames(r);
  if (!frames) return frames.error();
  auto folder = NewFolder::create(request.output, "orb_slam3.yaml");
  if (!folder) return folder.error();
  for (const char* name :
       {"mav0", "mav0/cam0", "mav0/cam0/data", "mav0/imu0", "mav0/state_groundtruth_estimate0"})
    if (auto made = folder->make_folder(name); !made) return made.error();
  const Crop crop = crop_of(request, r.first_ns);
  const TimeNs offset = from_seconds(request.offset_s);
  std::vector<FrameReader::Row> rows = frames->rows();
  std::erase_if(rows, [&](const FrameReader::Row& row) { return !crop.holds(row.t); });
  if (rows.empty()) return Error{r.frames_path, "no frames are left to be written", "widen the crop"};
  if (auto status = write_pictures(*folder, rows, offset); !status) return status.error();
  auto imu = open_imu(r);
  if (!imu) return imu.error();
  std::vector<ImuSample> samples;
  if (auto status = read_all(*std::move(imu), samples); !status) return status.error();
  shift_and_crop(samples, crop, offset);
  if (auto status = write_text_file(folder->path("mav0/imu0/data.csv"), imu_rows(samples)); !status)
    return status.error();
  if (!r.groundtruth_path.empty()) {
    auto truth = read_groundtruth(r);
    if (!truth) return truth.error();
    shift_and_crop(*truth, crop, offset);
    if (auto status = write_euroc(folder->path("mav0/state_groundtruth_estimate0/data.csv"), *truth); !status)
      return status.error();
  }
  const auto settings = orb_settings(r, frame_rate_hz(rows));
  if (!settings) return settings.error();
  if (auto status = write_text_file(folder->path("orb_slam3.yaml"), *settings); !status)
    return status.error();
  CalibratedCamera camera;
  camera.intrinsics = r.camera;
  camera.T_cam_imu = r.T_cam_body;
  if (auto status = write_kalibr_camera(folder->path("camchain-imucam.yaml"), camera); !status)
    return status.error();
  if (auto status = write_kalibr_imu(folder->path("imu.yaml"), r.imu_noise); !status) return status.error();
  if (auto status = folder->commit(); !status) return status.error();
  std::printf("%s: %zu frames, %zu IMU samples\n", request.output.c_str(), rows.size(), samples.size());
  return 0;
}

}  // namespace evpose
