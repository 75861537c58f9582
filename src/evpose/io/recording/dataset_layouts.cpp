// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/io/recording/dataset_layouts.h"

#include <algorithm>
#include <filesystem>

#include "evpose/io/formats/event_formats.h"
#include "evpose/io/formats/open_events.h"
#include "evpose/io/motion/imu_text.h"

namespace evpose {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kMostFiles = 20'000;  // looked at; frames of a sequence are more, and of no interest
constexpr std::size_t kMostCalibrations = 100;  // opened to see whether they are one
constexpr int kDepth = 2;                       // folders below the one named

/// Files below a folder by their names relative to it, sorted; those of the folder itself first.
std::vector<std::string> files_below(const fs::path& folder, int depth) {
  std::vector<std::string> own, below;
  std::error_code error;
  for (fs::directory_iterator it(folder, error), end; !error && it != end; it.increment(error)) {
    if (own.size() + below.size() > kMostFiles) break;
    const std::string name = it->path().filename().string();
    std::error_code ignored;
    if (it->is_regular_file(ignored)) {
      own.push_back(name);
    } else if (depth > 0 && it->is_directory(ignored)) {
      for (const std::string& file : files_below(it->path(), depth - 1)) below.push_back(name + "/" + file);
    }
  }
  std::sort(own.begin(), own.end());
  std::sort(below.begin(), below.end());
  own.insert(own.end(), below.begin(), below.end());
  return own;
}

std::string base_name(const std::string& path) { return path.substr(path.rfind('/') + 1); }

/// A folder being looked at.
class Look {
 public:
  explicit Look(std::string folder) : folder_(std::move(folder)), files_(files_below(folder_, kDepth)) {}

  const std::string& folder() const { return folder_; }
  const std::vector<std::string>& files() const { return files_; }
  bool has(const std::string& name) const {
    return std::find(files_.begin(), files_.end(), name) != files_.end();
  }
  std::string path(const std::string& name) const { return folder_ + "/" + name; }

  /// The first file whose own name ends so (and begins so).
  std::optional<std::string> find(const std::string& ending, const std::string& beginning = "") const {
    for (const std::string& file : files_)
      if (base_name(file).ends_with(ending) && base_name(file).starts_with(beginning)) return file;
    return std::nullopt;
  }

  /// Like find(), also beside the folder: in the parent and its folders, where data sets keep what several
  /// sequences share.
  std::optional<std::string> find_near(const std::string& ending, const std::string& containing = "") const {
    const auto fits = [&](const std::string& file) {
      const std::string name = base_name(file);
      return name.ends_with(ending) && name.find(containing) != std::string::npos;
    };
    for (const std::string& file : files_)
      if (fits(file)) return file;
    for (const std::string& file : files_below(folder_ + "/..", 1))
      if (fits(file)) return "../" + file;
    return std::nullopt;
  }

 private:
  std::string folder_;
  std::vector<std::string> files_;
};

void miss(FoundRecording& out, const std::string& where, const std::string& what, const std::string& fix) {
  out.missing.push_back({where, what, fix});
}

// TUM-VIE.

/// Sequences of TUM-VIE recorded with calibration A; all others have B.
bool has_calibration_a(const std::string& sequence) {
  for (const char* name : {"mocap-desk", "loop-floor", "skate-easy"})
    if (sequence.starts_with(name)) return true;
  return false;
}

Status take_tum_vie_calibration(const Look& look, const std::string& sequence, FoundRecording& out) {
  const std::string letter = has_calibration_a(sequence) ? "A" : "B";
  const std::string name = "camera-calibration" + letter + ".json";
  const auto cameras = look.find_near("calibration" + letter + ".json", "camera");
  if (!cameras) {
    miss(out, look.path(name), "no such file: the calibration of " + sequence,
         "download it into this folder");
    return {};
  }
  const auto file = read_calibration(look.path(*cameras));
  if (!file) return file.error();
  constexpr int kLeftEvent = 2;  // after the two grey cameras
  const auto camera = choose_camera(*file, kLeftEvent);
  if (!camera) return camera.error();
  out.camera = *camera;
  out.camera->sees = "event";
  out.imu_noise = file->imu_noise;
  out.calibration_files.push_back(*cameras);
  const auto mocap = look.find_near("calibration" + letter + ".json", "mocap-imu");
  if (!mocap) {
    miss(out, look.path("mocap-imu-calibration" + letter + ".json"),
         "no such file: ground truth cannot be carried from the markers to the IMU",
         "download it into this folder");
    out.files.groundtruth.reset();
    return {};
  }
  const auto markers = read_calibration(look.path(*mocap));
  if (!markers) return markers.error();
  for (const NamedTransform& t : markers->transforms)
    if (t.name == "T_imu_marker") out.files.T_body_imu = t.pose.inverse();
  if (!out.files.T_body_imu) return Error{look.path(*mocap), "no T_imu_marker", "download the file again"};
  out.files.groundtruth_body = "marker";
  out.calibration_files.push_back(*mocap);
  return {};
}

Expected<FoundRecording> tum_vie(const Look& look, const std::string& events) {
  FoundRecording out;
  out.layout = "TUM-VIE sequence";
  const std::string name = base_name(events);
  const std::string sequence = name.substr(0, name.find("-events_left"));
  out.files.name = sequence;
  out.files.events = events;
  out.files.imu = look.find("imu_data.txt");
  out.files.groundtruth = look.find("mocap_data.txt");
  for (const char* file : {"imu_data.txt", "mocap_data.txt"})
    if (!look.find(file))
      miss(out, look.path(file), "no such file",
           "unpack " + sequence + "-vi_gt_data.tar.gz into this folder");
  if (auto status = take_tum_vie_calibration(look, sequence, out); !status) return status.error();
  return out;
}

// VECtor.

/// The noise of VECtor's IMU as its authors publish it, for want of their file.
ImuNoise vector_noise() { return {1.26557e-3, 5.6387e-5, 7.2947e-4, 6.9961e-6, 200, {}}; }

/// The rig was calibrated twice: for these sequences, with motion capture, and for those in large rooms.
const char* vector_scale(const std::string& sequence) {
  for (const char* name : {"board", "corner", "robot", "desk", "sofa", "mountain", "hdr"})
    if (sequence.starts_with(name)) return "small_scale_";
  return "large_scale_";
}

/// A VECtor file found near, that of the sequence's scale rather than another; or nothing.
Expected<std::optional<CalibrationFile>> vector_file(const Look& look, const std::string& containing,
                                                     FoundRecording& out, const std::string& use) {
  auto name = look.find_near(".yaml", vector_scale(out.files.name) + containing);
  if (!name) name = look.find_near(".yaml", containing);
  if (!name) {
    miss(out, look.path("*" + containing + "*.yaml"), "no such file: " + use,
         "download the calibration folder of VECtor beside the sequences");
    return std::optional<CalibrationFile>();
  }
  auto file = read_calibration(look.path(*name));
  if (!file) return file.error();
  out.calibration_files.push_back(*name);
  return std::optional<CalibrationFile>(*std::move(file));
}

/// T_cam0_imu, T_cam0_cam2 and T_cam0_body to those of the left event camera and the ground truth's body.
Status take_vector_extrinsics(const Look& look, FoundRecording& out) {
  constexpr const char* kLeftEvent = "cam2";
  const auto joint = vector_file(look, "joint_camera_extrinsic", out, "the cameras' places");
  if (!joint) return joint.error();
  const auto imu = vector_file(look, "camera_imu_extrinsic", out, "the IMU's place");
  if (!imu) return imu.error();
  const auto mocap = vector_file(look, "camera_mocap_extrinsic", out, "the place of the motion-capture body");
  if (!mocap) return mocap.error();
  std::optional<Pose> T_cam0_imu;
  if (*imu && !(*imu)->cameras.empty()) {
    T_cam0_imu = (*imu)->cameras.front().T_cam_imu;
    out.camera->has_timeshift = (*imu)->cameras.front().has_timeshift;
    out.camera->timeshift_cam_imu_s = 0;  // of the grey camera: events are hardware-synchronised
  }
  if (*joint && T_cam0_imu)
    for (const CalibratedCamera& camera : (*joint)->cameras)
      if (camera.name == kLeftEvent && camera.T_cam_cam0)
        out.camera->T_cam_imu = *camera.T_cam_cam0 * *T_cam0_imu;
  if (*mocap && T_cam0_imu)
    for (const NamedTransform& t : (*mocap)->transforms)
      if (t.name == "cam0.T_cam_body") out.files.T_body_imu = t.pose.inverse() * *T_cam0_imu;
  if (out.files.T_body_imu) {
    out.files.groundtruth_body = "marker";
  } else if (out.files.groundtruth) {
    out.files.groundtruth.reset();  // of another body than the IMU: no ground truth
  }
  return {};
}

Expected<FoundRecording> vector(const Look& look, const std::string& events) {
  FoundRecording out;
  out.layout = "VECtor sequence";
  const std::string name = base_name(events);
  const std::string sequence = name.substr(0, name.find(".synced"));
  out.files.name = sequence;
  out.files.events = events;
  out.files.imu = look.find(".synced.imu.txt");
  out.files.groundtruth = look.find(".synced.gt.txt");
  if (!out.files.imu) miss(out, look.path(sequence + ".synced.imu.txt"), "no such file", "download it");
  if (!out.files.groundtruth)
    miss(out, look.path(sequence + ".synced.gt.txt"), "no such file", "download it");
  const auto intrinsics =
      vector_file(look, "left_event_camera_intrinsic", out, "the event camera's intrinsics");
  if (!intrinsics) return intrinsics.error();
  if (!*intrinsics) return out;
  const auto camera = choose_camera(**intrinsics);
  if (!camera) return camera.error();
  out.camera = *camera;
  if (auto status = take_vector_extrinsics(look, out); !status) return status.error();
  if (const auto model = look.find_near(".yaml", "imu_intrinsic")) {
    const auto noise = read_calibration(look.path(*model));
    if (noise) out.imu_noise = noise->imu_noise;
  }
  if (!out.imu_noise) out.imu_noise = vector_noise();
  return out;
}

// Anything else.

/// A calibration that holds a camera, best with its place on the IMU.
std::optional<std::string> find_calibration(const Look& look) {
  std::optional<std::string> any;
  std::size_t tried = 0;
  for (const std::string& name : look.files()) {
    const bool kind = name.ends_with(".yaml") || name.ends_with(".yml") || name.ends_with(".json") ||
                      base_name(name) == "calib.txt";
    const std::string own = base_name(name);
    if (!kind || own == "recording.yaml" || own == "scenario.yaml" || own == "metadata.yaml") continue;
    if (++tried > kMostCalibrations) break;
    const auto file = read_calibration(look.path(name));
    if (!file || file->cameras.empty() || !file->cameras.front().intrinsics) continue;
    if (file->cameras.front().T_cam_imu) return name;
    if (!any) any = name;
  }
  return any;
}

/// An autopilot's log: it has the ending of some event files, and an IMU, but no events.
bool is_autopilot_log(const std::string& path) {
  const auto format = find_event_format(path, "");
  return format && std::string_view((*format)->name) == "dataflash";
}

/// The first file that looks like IMU text, else an autopilot's log.
std::optional<std::string> find_imu(const Look& look) {
  for (const std::string& name : look.files()) {
    const std::string own = base_name(name);
    const bool kind = own.ends_with(".csv") || own.ends_with(".txt");
    if (!kind || name.find("imu") == std::string::npos) continue;
    if (recognise_imu_text(look.path(name))) return name;
  }
  for (const std::string& name : look.files())
    if ((name.ends_with(".bin") || name.ends_with(".BIN")) && is_autopilot_log(look.path(name))) return name;
  return std::nullopt;
}

bool holds_events(const std::string& path) {
  for (const EventFormat& format : event_formats()) {
    if (std::string_view(format.name) == "text") continue;
    std::string_view endings = format.extensions;
    while (!endings.empty()) {
      const std::size_t end = std::min(endings.find(' '), endings.size());
      if (!endings.substr(0, end).empty() && path.ends_with(endings.substr(0, end))) return true;
      endings.remove_prefix(std::min(end + 1, endings.size()));
    }
  }
  return false;
}

std::optional<std::string> find_events(const Look& look) {
  for (const char* usual :
       {"events.h5", "events.raw", "events.txt", "events.csv", "events.aedat4", "events.bag"})
    if (auto name = look.find(usual)) return name;
  for (const std::string& name : look.files())
    if (holds_events(name) && base_name(name).find("map") == std::string::npos &&
        base_name(name).find("right") == std::string::npos && !is_autopilot_log(look.path(name)))
      return name;
  return std::nullopt;
}

/// True where the file of the events holds such a stream, too.
bool holds(const std::string& path, StreamKind kind) {
  if (path.ends_with(".h5")) return false;
  const auto streams = list_streams(path);
  return streams && std::any_of(streams->begin(), streams->end(), [&](const StreamInfo& stream) {
           return stream.kind == kind && stream.messages != 0;
         });
}

/// The list of frames, ours or as EuRoC has it.
std::optional<std::string> find_frames(const Look& look) {
  for (const char* usual : {"frames/timestamps.csv", "cam0/data.csv", "mav0/cam0/data.csv"})
    if (look.has(usual)) return usual;
  return std::nullopt;
}

/// Fills what recording.yaml or an own layout has not named.
void look_for_the_rest(const Look& look, FoundRecording& out) {
  RecordingOverrides& f = out.files;
  if (!f.events && !look.has("events.h5")) f.events = find_events(look);
  if (!f.calibration && !look.has("camchain-imucam.yaml") && !out.camera)
    f.calibration = find_calibration(look);
  if (!f.imu && !look.has("imu.csv")) {
    f.imu = find_imu(look);
    if (!f.imu && f.events && holds(look.path(*f.events), StreamKind::imu)) f.imu = f.events;
  }
  if (!f.groundtruth && !look.has("groundtruth.tum")) {
    for (const char* usual : {"groundtruth.txt", "groundtruth.csv", "stamped_groundtruth.txt"})
      if (!f.groundtruth) f.groundtruth = look.find(usual);
    if (!f.groundtruth && f.events && holds(look.path(*f.events), StreamKind::poses))
      f.groundtruth = f.events;
  }
  if (!f.frames) f.frames = find_frames(look);
  if (!f.contours && !look.has("contours.ply")) f.contours = look.find("contours.ply");
}

Expected<FoundRecording> look_at_folder(const std::string& folder) {
  const Look look(folder);
  FoundRecording out;
  if (look.has("recording.yaml")) {
    auto read = read_recording_yaml(look.path("recording.yaml"));
    if (!read) return read.error();
    out.files = *std::move(read);
  } else if (!look.has("events.h5")) {
    if (const auto events = look.find("-events_left.h5")) return tum_vie(look, *events);
    if (const auto events = look.find(".left_event.hdf5")) return vector(look, *events);
    if (const auto cameras = look.find_near("cam_to_cam.yaml")) {
      out.layout = "DSEC sequence";
      out.files.calibration = *cameras;
      for (const std::string& name : look.files())
        if (name.ends_with("left/events.h5")) out.files.events = name;
    }
  }
  if (out.layout.empty()) out.layout = "recording folder";
  look_for_the_rest(look, out);
  if (!out.files.events && !look.has("events.h5") && !out.files.frames)
    miss(out, look.path("events.h5"), "no such file",
         "add the events, or name another file under files: in recording.yaml");
  if (!out.files.calibration && !look.has("camchain-imucam.yaml") && !out.camera)
    miss(out, look.path("camchain-imucam.yaml"), "no such file",
         "add the calibration as Kalibr, Basalt, ROS or OpenCV write it");
  return out;
}

/// A file that holds events: what stands beside it belongs to it.
FoundRecording look_beside(const fs::path& file) {
  const std::string folder = file.has_parent_path() ? file.parent_path().string() : ".";
  const Look look(folder);
  FoundRecording out;
  out.layout = "single file";
  out.files.name = file.stem().string();
  out.files.events = file.filename().string();
  if (holds(file.string(), StreamKind::imu)) out.files.imu = out.files.events;
  look_for_the_rest(look, out);
  return out;
}

}  // namespace

Expected<FoundRecording> find_recording(const std::string& path) {
  std::string clean = path;
  while (clean.size() > 1 && clean.ends_with('/')) clean.pop_back();
  std::error_code ignored;
  const auto status = fs::status(clean, ignored);
  if (!fs::exists(status)) return Error{path, "no such recording folder or file", "check the path"};
  const bool bag_folder = fs::is_directory(status) && fs::exists(clean + "/metadata.yaml", ignored);
  if (fs::is_directory(status) && !bag_folder) {
    auto out = look_at_folder(clean);
    if (!out) return out.error();
    out->folder = clean;
    if (out->files.name.empty()) out->files.name = base_name(clean);
    return out;
  }
  if (!bag_folder && !holds_events(clean))
    return Error{path, "is no recording", "give a folder, a bag or a file of events"};
  FoundRecording out = look_beside(clean);
  const fs::path parent = fs::path(clean).parent_path();
  out.folder = parent.empty() ? "." : parent.string();
  return out;
}

}  // namespace evpose
