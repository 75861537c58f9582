// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/tracker/snapshot.h"

#include <algorithm>
#include <cmath>

#include "evpose/registration/temporal_field.h"

namespace evpose {

std::vector<float> decayed(const TimeSurface& surface, std::uint32_t now_us, double decay_s) {
  std::vector<float> out;
  out.reserve(static_cast<std::size_t>(surface.width()) * static_cast<std::size_t>(surface.height()));
  for (int y = 0; y < surface.height(); ++y)
    for (int x = 0; x < surface.width(); ++x) {
      const std::uint32_t on = surface.last(x, y, Polarity::on), off = surface.last(x, y, Polarity::off);
      const std::uint32_t last = std::max(on, off);
      const double age_s = 1e-6 * (now_us > last ? now_us - last : 0);
      const auto value = static_cast<float>(last == 0 ? 0 : std::exp(-age_s / decay_s));
      out.push_back(on >= off ? value : -value);
    }
  return out;
}

std::vector<Snapshot::Point> project_points(const ContourView& view, std::span<const std::uint32_t> points,
                                            const Pose& T_map_body, const TimeSurface* surface,
                                            std::uint32_t now_us, double decay_s) {
  constexpr double kMatchedField = 0.3679;  // 1/e
  std::vector<Snapshot::Point> out;
  const ImageSize size = view.camera.size();
  const Pose T_cam_map = (T_map_body * view.T_body_cam).inverse();
  for (const std::uint32_t i : points) {
    const auto pixel = view.camera.project(T_cam_map * view.map.position(i));
    if (!pixel || !size.contains(*pixel)) continue;
    const double field =
        surface == nullptr
            ? 0
            : sample_field(*surface, *pixel, now_us, 1e6 * decay_s, FieldKernel::bilinear).value;
    out.push_back({static_cast<float>(pixel->x()), static_cast<float>(pixel->y()), field >= kMatchedField});
  }
  return out;
}

}  // namespace evpose
