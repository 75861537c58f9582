// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/report/run_pictures.h"

#include <filesystem>

#include "evpose/event/time_surface.h"
#include "evpose/io/maps/contour_files.h"
#include "evpose/io/maps/ply.h"
#include "evpose/io/recording/recording.h"
#include "evpose/map/contour_index.h"
#include "evpose/map/visible_set.h"

namespace evpose {
namespace {

constexpr double kDecay_s = 0.02;
constexpr double kPacket_s = 1e-3;
constexpr double kStride_px = 4;  // between drawn points of one contour, in an image 640 wide
constexpr double kWidth_px = 640;

VisibleSetConfig drawn_points(ImageSize size) {
  VisibleSetConfig config;
  config.stride_px = std::max(2.0, kStride_px * size.width / kWidth_px);
  config.refresh_px = 0;  // pictures lie far apart: chosen anew for each
  config.margin_px = 0;
  return config;
}

}  // namespace

struct RunPictures::State {
  State(Recording of, ContourMap on, std::shared_ptr<const Camera> with)
      : recording(std::move(of)),
        map(std::move(on)),
        camera(std::move(with)),
        T_body_cam(recording.T_cam_body.inverse()),
        index(map),
        visible(index, *camera, drawn_points(camera->size())),
        surface(camera->size().width, camera->size().height) {}

  Status read_until(TimeNs t);
  std::uint32_t stamp(TimeNs t) {
    return clock.stamp(t, [this](std::uint32_t shift) { surface.rebase(shift); });
  }

  Recording recording;
  ContourMap map;
  std::shared_ptr<const Camera> camera;
  Pose T_body_cam;
  ContourSegments segments;  ///< none: drawing needs no contrast
  ContourIndex index;
  VisibleSet visible;
  TimeSurface surface;
  StampClock clock;
  std::unique_ptr<EventReader> events;
  EventPacket packet;
  std::size_t taken = 0;  ///< events of the packet
};

Status RunPictures::State::read_until(TimeNs t) {
  while (true) {
    for (; taken < packet.events.size(); ++taken) {
      const Event& e = packet.events[taken];
      if (packet.time(e) > t) return {};
      if (e.x < surface.width() && e.y < surface.height())
        surface.insert(e.x, e.y, e.on != 0 ? Polarity::on : Polarity::off, stamp(packet.time(e)));
    }
    const auto more = events->next(packet);
    if (!more) return more.error();
    taken = 0;
    if (*more) continue;
    packet.events.clear();
    return {};
  }
}

RunPictures::RunPictures(std::unique_ptr<State> state) : state_(std::move(state)) {}
RunPictures::RunPictures(RunPictures&&) noexcept = default;
RunPictures& RunPictures::operator=(RunPictures&&) noexcept = default;
RunPictures::~RunPictures() = default;

const ContourMap& RunPictures::map() const { return state_->map; }
ImageSize RunPictures::size() const { return state_->camera->size(); }

Expected<ContourMap> read_run_map(const RunFiles& run) {
  if (run.input.map.empty())
    return Error{run.folder, "does not say what it was made from", "give a run of evpose track"};
  auto map = read_contour_map(run.input.map);
  if (!map || run.input.occluders.empty()) return map;
  auto mesh = read_ply_mesh(run.input.occluders, map->anchor);
  if (!mesh) return mesh.error();
  map->occluders = std::move(*mesh);
  return map;
}

Expected<RunPictures> RunPictures::open(const RunFiles& run, ContourMap map) {
  if (run.input.recording.empty())
    return Error{run.folder, "does not say what it was made from", "give a run of evpose track"};
  const auto recording = open_recording(run.input.recording, run.calibration);
  if (!recording) return recording.error();
  auto camera = make_camera(recording->camera);
  if (!camera) return camera.error();
  auto state = std::make_unique<State>(*recording, std::move(map), std::move(*camera));
  auto events = open_events(state->recording, kPacket_s);
  if (!events) return events.error();
  state->events = std::move(*events);
  return RunPictures(std::move(state));
}

Expected<RunPictures::Moment> RunPictures::look(const RunRow& row) {
  State& s = *state_;
  if (auto status = s.read_until(row.t); !status) return status.error();
  Moment out{s.surface, s.stamp(row.t), {}};
  if (!row.valid() || s.map.points.empty()) return out;
  const ContourView view{s.map, s.segments, *s.camera, s.T_body_cam, 0};
  const auto& chosen = s.visible.choose(row.T_map_body * s.T_body_cam);
  out.points = project_points(view, chosen, row.T_map_body, &s.surface, out.now_us, kDecay_s);
  return out;
}

Expected<RgbImage> RunPictures::draw(const RunRow& row) {
  const auto moment = look(row);
  if (!moment) return moment.error();
  std::vector<OverlayPoint> points;
  for (const auto& p : moment->points) points.push_back({p.x, p.y, p.matched});
  const TimeSurface& surface = moment->surface;
  return draw_overlay(surface.width(), surface.height(), decayed(surface, moment->now_us, kDecay_s), points);
}

}  // namespace evpose
