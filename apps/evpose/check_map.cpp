// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>
#include <numbers>

#include "check_parts.h"
#include "commands.h"
#include "evpose/map/visible_set.h"
#include "evpose/map_build/gravity.h"
#include "evpose/report/map_accuracy.h"
#include "evpose/run/plausibility.h"
#include "evpose/run/start.h"
#include "sheet.h"

namespace evpose {
namespace {

constexpr double kDegrees = 180 / std::numbers::pi;
constexpr double kTilt_deg = 1;          // of the map's up, beyond what a cloud is levelled to
constexpr int kSurveyCells = 10;         // along the longer side
constexpr double kLeastGoodShare = 0.5;  // of the volume, to 15 mm
constexpr std::size_t kViews = 20;       // along the ground truth
constexpr double kUnheld_mm = 50;        // position that the contours in view tell this badly is not held
constexpr std::size_t kFewestPoints = 50;

/// The position's error that the contours in a view leave, as surveys have it; and the points in view.
ViewAccuracy accuracy_at(const ContourMap& map, VisibleSet& visible, const CheckedRecording& data,
                         const Pose& T_map_body) {
  const Pose T_map_cam = T_map_body * data.recording.T_cam_body.inverse();
  return expected_accuracy(map, visible.choose(T_map_cam), *data.camera, T_map_cam);
}

void check_views(Checklist& list, const CheckedRecording& data, const ContourMap& map,
                 const StartState& start) {
  const ContourIndex index(map);
  VisibleSetConfig config;
  config.updates = 1;
  VisibleSet visible(index, *data.camera, config);
  const ViewAccuracy first = accuracy_at(map, visible, data, start.T_map_body);
  if (first.points < kFewestPoints)
    return list.problem(
        "view", {map.source, text("from the start the camera sees ", first.points, " points of the map"),
                 "check the start, T_cam_imu, and that the map holds what the camera looks at"});
  std::vector<double> sigma_mm{first.worst_mm};
  const auto& truth = data.truth;
  for (std::size_t i = 0; i < truth.size(); i += truth.size() / kViews + 1)
    if (truth[i].t >= data.recording.first_ns && truth[i].t <= data.recording.last_ns)
      sigma_mm.push_back(accuracy_at(map, visible, data, truth[i].pose).worst_mm);
  std::sort(sigma_mm.begin(), sigma_mm.end());
  const double median_mm = sigma_mm[sigma_mm.size() / 2];
  const std::string where = sigma_mm.size() > 1 ? "along the ground truth" : "at the start";
  if (median_mm > kUnheld_mm)
    return list.problem("view",
                        {map.source,
                         text("the contours in view ", where, " tell the position to ",
                              median_mm < 1000 ? fixed(median_mm, 0) + " mm" : "no better than a metre"),
                         "face structure of several directions, or give a map that has it"});
  list.ok("view", text(first.points, " points in view at the start; the position is told to ",
                       fixed(median_mm, 1), " mm ", where));
}

void check_up(Checklist& list, const ContourMap& map) {
  const auto up = map_build::find_up(map);
  if (!up.known) return;
  const double tilt_deg = kDegrees * up.tilt_rad;
  if (tilt_deg > kTilt_deg)
    list.problem("map",
                 {map.source, text("floors and walls say that up lies ", fixed(tilt_deg, 1), " deg off z"),
                  "build it with `evpose map build --level`; gravity is taken to be along z"});
  else
    list.ok("map", "up is z to " + fixed(tilt_deg, 1) + " deg, as floors and walls say");
}

}  // namespace

std::shared_ptr<const ContourMap> check_map(Checklist& list, const TrackRequest& request,
                                            const Recording& recording) {
  const auto read = load_map(request, recording);
  if (!read) {
    list.problem("map", read.error());
    return nullptr;
  }
  const ContourMap& map = **read;
  const MapFigures f = figures_of(map);
  const Eigen::Vector3d size = f.high - f.low;
  if (const auto doubt = doubt_map_size(map))
    list.problem("map", *doubt);
  else
    list.ok("map", text(fixed(f.length_m, 0), " m of contours in ", fixed(size.x(), 1), " x ",
                        fixed(size.y(), 1), " x ", fixed(size.z(), 1), " m"));
  check_up(list, map);
  const AccuracyShares shares =
      shares_of(survey_accuracy(map, survey_camera(), 30 / kDegrees, survey_heights(map), kSurveyCells));
  const std::string words =
      text("a pose is told to 15 mm in ", std::round(100 * shares.to_15mm), " % of the volume");
  if (shares.to_15mm < kLeastGoodShare)
    list.note("map", words + "; `evpose map info --report` shows where");
  else
    list.ok("map", words);
  return *read;
}

void check_start(Checklist& list, const TrackRequest& request, const CheckedRecording& data,
                 const ContourMap& map) {
  FusionConfig config;
  const auto placement = read_map_placement(map.source);
  if (!placement) return list.problem("start", placement.error());
  const auto start = choose_start(request.init, data.recording, data.truth, {}, *placement, &config);
  if (!start) return list.problem("start", start.error());
  const int before = list.problems();
  if (const auto doubt = doubt_start_place(map, start->T_map_body)) list.problem("start", *doubt);
  if (const auto doubt = doubt_start_attitude(data.imu, *start, data.recording.imu_path))
    list.problem("start", *doubt);
  if (list.problems() == before) list.ok("start", start_words(request.init, !data.truth.empty()));
  if (data.camera) check_views(list, data, map, *start);
}

}  // namespace evpose
