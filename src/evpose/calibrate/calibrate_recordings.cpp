// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/calibrate/calibrate_recordings.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <utility>

#include "evpose/calibrate/board_start.h"
#include "evpose/calibrate/calibration_words.h"
#include "evpose/calibrate/data_sheet.h"
#include "evpose/calibrate/joint_calibration.h"
#include "evpose/core/log.h"
#include "evpose/io/calibration/kalibr.h"
#include "evpose/io/files/atomic_file.h"
#include "evpose/io/maps/map_h5.h"
#include "evpose/run/progress.h"

namespace evpose {
namespace {

constexpr double kBoardSigmas = 3;    // events are offset from a board's points by more than these scatter
constexpr double kBoardPlace_px = 1;  // pictures of events show a board ahead of or behind where it is
constexpr double kBoardVelocity_m_s = 0.1, kBoardRate_rad_s = 0.1;  // mean over 0.2 s
constexpr double kBoardGravity_rad = 0.02;
constexpr double kEnough_mev_s = 8;  // near contours: what more of them say is known from these
constexpr double kRefuted = 5;       // given sigmas by which the events may contradict what was given

bool is_known(const CalibrationSigma& sigma, const Recording& recording) {
  const bool mounting = sigma.of_rotation_rad().isZero(0) && sigma.of_translation_m().isZero(0);
  return sigma.of_intrinsics(recording.camera).isZero(0) &&
         (!recording.has_imu || (mounting && sigma.of_time_s() == 0));
}

/// Contours of a hall tell the distortion of most of the image, a board's that of where it was held.
CalibrationSigma start_sigma(const CalibrationSigma& stated, const CameraIntrinsics& camera, bool board) {
  return board ? any_lens_sigma(stated, camera) : data_sheet_sigma(stated, camera);
}

Expected<TrackJob> job_of(const TrackRequest& request, const RunConfig& config, bool board) {
  auto job = prepare(request, config);
  if (!job) return job;
  // It looks for a pose as the given calibration would see it; the alignment of the start looks for both.
  job->config.tracker.relocalization.on = false;
  double& most_mev_s = job->config.tracker.events.most_mev_s;
  most_mev_s = most_mev_s > 0 ? std::min(most_mev_s, kEnough_mev_s) : kEnough_mev_s;
  Recording& recording = job->recording;
  recording.camera = with_distortion(recording.camera);
  const CalibrationSigma sigma = start_sigma(recording.calibration_sigma, recording.camera, board);
  if (is_known(sigma, recording))
    return Error{recording.calibration_path, "states that all of it is known",
                 "leave out the sigmas that are zero, or give another one with --start"};
  recording.calibration_sigma = sigma;
  job->setup.intrinsics = recording.camera;
  job->setup.calibration_sigma = sigma;
  auto camera = make_camera(recording.camera);
  if (!camera) return Error{recording.calibration_path, camera.error().what, camera.error().fix};
  job->setup.camera = *camera;
  return job;
}

/// Of the recordings, all with the calibration of the request or else of the first one.
Expected<std::vector<Recording>> open_all(const CalibrateRequest& request, std::string* calibration) {
  *calibration = request.track.calibration;
  std::vector<Recording> out;
  for (const std::string& path : request.recordings) {
    auto recording = open_recording(path, *calibration);
    if (!recording) return recording.error();
    if (calibration->empty()) *calibration = recording->calibration_path;
    if (!out.empty() && recording->has_imu != out.front().has_imu)
      return Error{path, "has an IMU and the first recording has none, or the other way round",
                   "calibrate recordings of one kind together"};
    out.push_back(std::move(*recording));
  }
  return out;
}

/// The printed board that is the map; none if it is another map, or the request says where to start.
Expected<std::optional<Board>> board_to_find(const TrackRequest& request, const Recording& recording) {
  if (request.init != "auto") return std::optional<Board>();
  const auto path = map_path(request, recording);
  if (!path) return path.error();
  const auto words = read_map_board(*path);
  return words ? Expected(read_board_words(*words)) : words.error();
}

/// As --init has it.
std::string init_words(const StartState& start) {
  const Pose& T = start.T_map_body;
  char words[256];
  std::snprintf(words, sizeof words, "%.17g,%.17g,%.17g,%.17g,%.17g,%.17g,%.17g@%.9f", T.p.x(), T.p.y(),
                T.p.z(), T.q.x(), T.q.y(), T.q.z(), T.q.w(), to_seconds(start.t));
  return words;
}

/// The start as the board's pictures have it, with what it may be off.
void begin_before_board(const BoardStart& found, std::size_t k, TrackJob* job) {
  job->start = found.starts[k];
  FusionConfig& fusion = job->config.tracker.fusion;
  const double seen_rad = kBoardPlace_px / job->setup.camera->focal_px();
  fusion.start_rotation_sigma_rad = std::max(fusion.start_rotation_sigma_rad, seen_rad);
  fusion.start_position_sigma_m =
      std::max(fusion.start_position_sigma_m, seen_rad * job->start.T_map_body.p.norm());
  if (found.sightings[k].tells_velocity()) {
    fusion.start_velocity_sigma_m_s = kBoardVelocity_m_s;
    fusion.start_angular_rate_sigma_rad_s = kBoardRate_rad_s;
  }
  if (found.gravity) {
    fusion.gravity_map = *found.gravity;
    fusion.calibration.gravity = true;
    fusion.calibration.start_gravity_sigma_rad = kBoardGravity_rad;
  }
}

/// What there is to do, and what a board has told.
struct Work {
  std::vector<TrackJob> jobs;
  std::optional<BoardBeginning> board;
};

/// None where `progress` ends it.
Expected<std::optional<Work>> work_of(const CalibrateRequest& request,
                                      const std::function<bool(double)>& progress) {
  TrackRequest one = request.track;
  const auto config = load_config(one);
  if (!config) return config.error();
  if (!config->tracker.fusion.calibration.on)
    return Error{"fusion.calibration.on", "is false: nothing would be calibrated", "leave it out"};
  const auto recordings = open_all(request, &one.calibration);
  if (!recordings) return recordings.error();
  const auto board = board_to_find(one, recordings->front());
  if (!board) return board.error();
  Work out;
  std::optional<BoardStart> found;
  if (*board) {
    const CameraIntrinsics given = with_distortion(recordings->front().camera);
    const CalibrationSigma sigma = start_sigma(recordings->front().calibration_sigma, given, true);
    auto start = find_board_start(*recordings, **board, given, sigma, progress);
    if (!start) return start.error();
    if (!*start) return std::optional<Work>();
    found = std::move(*start);
    out.board =
        BoardBeginning{found->correction, sigma.of_intrinsics(given).cwiseMin(kBoardSigmas * found->sigma),
                       found->sightings};
  }
  for (std::size_t k = 0; k < recordings->size(); ++k) {
    one.recording = request.recordings[k];
    if (found) one.init = init_words(found->starts[k]);
    auto job = job_of(one, *config, found.has_value());
    if (!job) return job.error();
    if (found) begin_before_board(*found, k, &*job);
    out.jobs.push_back(std::move(*job));
  }
  return std::optional(std::move(out));
}

FlightMotion motion_of(const JointCalibration& joint, std::size_t k) {
  FlightMotion out;
  out.name = joint.job(k).recording.name;
  out.accepted = joint.accepted_share(k);
  out.coverage = joint.residuals_of(k).coverage();
  const std::vector<FusionState>& states = joint.flight(k).trajectory();
  out.duration_s = to_seconds(states.back().t - states.front().t);
  Eigen::Vector3d rates = Eigen::Vector3d::Zero();
  double speeds = 0, accelerations = 0;
  // Over a while, since velocities from state to state are noisy.
  constexpr std::size_t kApart = 15;
  std::size_t count = 0;
  for (std::size_t i = kApart; i < states.size(); i += kApart, ++count) {
    const FusionState &a = states[i - kApart], &b = states[i];
    const double dt_s = to_seconds(b.t - a.t);
    rates += (so3::log(a.nav.T_map_body.q.conjugate() * b.nav.T_map_body.q) / dt_s).cwiseAbs2();
    speeds += b.nav.velocity.squaredNorm();
    accelerations += (b.nav.velocity - a.nav.velocity).squaredNorm() / (dt_s * dt_s);
  }
  const double n = static_cast<double>(std::max<std::size_t>(1, count));
  out.rate_deg_s = (rates / n).cwiseSqrt() * (180 / M_PI);
  out.speed_m_s = std::sqrt(speeds / n);
  out.acceleration_m_s2 = std::sqrt(accelerations / n);
  return out;
}

CalibrationPage page_of(const JointCalibration& joint, const RunCalibration& calibration) {
  const TrackJob& first = joint.job(0);
  CalibrationPage page;
  page.title = "Calibration of " + first.recording.name;
  const std::size_t more = joint.size() - 1;
  page.subtitle = text("map ", first.map->source.substr(first.map->source.rfind('/') + 1),
                       more > 0 ? text(", and ", more, " more recording", more > 1 ? "s" : "") : "",
                       first.recording.has_imu ? "" : ", no IMU: the camera alone is calibrated");
  page.size = first.recording.camera.size;
  page.numbers = numbers_of(calibration);
  if (const auto imu = joint.imu())
    page.imu_axes =
        axes_numbers(first.setup.imu_noise.axes, imu->axes, first.config.tracker.fusion.imu_scale_sigma);
  page.correlation = *calibration.found.sigma.correlation;
  const auto found = make_camera(*calibration.found.intrinsics);
  if (found) page.before = model_difference(*first.setup.camera, **found);
  page.after = joint.residuals().arrows();
  page.radius = joint.residuals().by_radius();
  for (std::size_t k = 0; k < joint.size(); ++k) page.flights.push_back(motion_of(joint, k));
  page.words = calibration_words(page);
  return page;
}

/// The number that contradicts the events most, in words; empty if none does.
std::string refuted_words(const JointCalibration& joint, const std::vector<CalibrationNumber>& numbers) {
  Eigen::Index worst = 0;
  const Eigen::VectorXd off = joint.contradiction();
  if (off.size() == 0 || !(off.cwiseAbs().maxCoeff(&worst) > kRefuted)) return "";
  // Those that the file lists, by the largest change in given sigmas.
  const auto number = std::ranges::max_element(numbers, {}, [](const CalibrationNumber& n) {
    return n.given_sigma > 0 ? std::abs(n.found - n.given) / n.given_sigma : 0;
  });
  return text("the events refute the given calibration by ", std::lround(std::abs(off(worst))),
              " of its sigmas (", number->name, "); it was taken for a data sheet's");
}

struct Estimate {
  std::unique_ptr<JointCalibration> joint;
  RunCalibration calibration;
};

Expected<Estimate> estimate(Work work, const TrackRequest& request,
                            const JointCalibration::Progress& progress) {
  Estimate out{std::make_unique<JointCalibration>(std::move(work.jobs), std::move(work.board)), {}};
  if (auto ok = out.joint->estimate(request, progress); !ok) return ok.error();
  if (out.joint->interrupted()) return out;
  const auto found = run_calibration(out.joint->job(0), out.joint->found());
  EVPOSE_CHECK(found.has_value());
  out.calibration = *found;
  out.calibration.found.sigma.correlation = out.joint->correlation();
  return out;
}

/// Again, as if the calibration's sigmas had not been stated.
Work without_stated_sigmas(Work work) {
  for (TrackJob& job : work.jobs) {
    job.recording.calibration_sigma = only_data_sheet(job.recording.calibration_sigma, job.recording.camera);
    job.setup.calibration_sigma = job.recording.calibration_sigma;
  }
  return work;
}

std::string report_path(const std::string& chain) {
  return std::filesystem::path(chain).replace_extension(".html").string();
}

/// camchain.yaml: camchain-imu.yaml.
std::string imu_path(const std::string& chain) {
  const std::filesystem::path path(chain);
  return path.parent_path() / (path.stem().string() + "-imu.yaml");
}

Status check_output(const TrackRequest& request) {
  for (const std::string& path : {request.output, report_path(request.output), imu_path(request.output)})
    if (!request.replace && std::filesystem::exists(path))
      return Error{path, "exists", "give another name with -o, or --force"};
  return {};
}

}  // namespace

Expected<std::optional<CalibrateOutcome>> calibrate_recordings(const CalibrateRequest& request) {
  if (auto ok = check_output(request.track); !ok) return ok.error();
  const auto told = [&](Progress& shown) {
    return [&](double share) {
      shown.at(share);
      return !(request.track.interrupted && request.track.interrupted());
    };
  };
  Progress looking("looking for the board");
  const auto planned = work_of(request, told(looking));
  looking.done();
  if (!planned) return planned.error();
  if (!*planned) return std::optional<CalibrateOutcome>();
  const Work& work = **planned;
  for (const TrackJob& job : work.jobs)
    for (const Error& finding : job.findings) log_warning(finding.line());
  Progress shown("calibrating");
  const auto progress = told(shown);
  auto found = estimate(work, request.track, progress);
  if (found && found->joint->interrupted()) return std::optional<CalibrateOutcome>();
  const Recording& first = work.jobs.front().recording;
  const CalibrationSigma& stated = first.calibration_sigma;
  const bool narrow =
      stated.intrinsics && only_data_sheet(stated, first.camera).intrinsics != stated.intrinsics;
  std::string refuted;
  if (narrow && found) refuted = refuted_words(*found->joint, numbers_of(found->calibration));
  if (narrow && !found)
    refuted =
        "the contours are nowhere near where the given calibration and its sigmas have them; it was taken "
        "for a data sheet's";
  if (!refuted.empty()) {
    found = estimate(without_stated_sigmas(work), request.track, progress);
    if (found && found->joint->interrupted()) return std::optional<CalibrateOutcome>();
  }
  if (!found) return found.error();
  shown.done();

  CalibrateOutcome out;
  out.page = page_of(*found->joint, found->calibration);
  out.converged = found->joint->converged();
  if (!out.converged)
    out.page.words.insert(out.page.words.begin(),
                          "the passes did not come to rest: trust no sigma of this calibration");
  if (!refuted.empty()) out.page.words.insert(out.page.words.begin(), refuted);
  out.report = report_path(request.track.output);
  if (auto ok = write_kalibr_camera(request.track.output, found->calibration.found); !ok) return ok.error();
  if (const auto imu = found->joint->imu()) {
    out.imu_model = imu_path(request.track.output);
    if (auto ok = write_kalibr_imu(out.imu_model, *imu); !ok) return ok.error();
  }
  if (auto ok = write_text_file(out.report, calibration_page(out.page)); !ok) return ok.error();
  return std::optional<CalibrateOutcome>(std::move(out));
}

}  // namespace evpose
