// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/sim/sensors/frame_camera.h"

#include <algorithm>
#include <cmath>

#include "evpose/core/config.h"
#include "evpose/core/parallel.h"
#include "evpose/io/files/atomic_file.h"
#include "evpose/io/files/new_folder.h"
#include "evpose/io/files/png_file.h"

namespace evpose::sim {
namespace {

constexpr double kReadNoise_e = 10;

std::string file_name(int number) {
  const std::string digits = std::to_string(number);
  return std::string(6 - std::min<std::size_t>(6, digits.size()), '0') + digits + ".png";
}

}  // namespace

std::uint8_t grey_value(double luminance, double white, double range_db) {
  constexpr double kGamma = 1 / 2.2;
  const double black = white * std::pow(10, -range_db / 20);
  if (!(luminance > black)) return 0;
  return static_cast<std::uint8_t>(std::lround(255 * std::pow(std::min(luminance / white, 1.0), kGamma)));
}

double with_sensor_noise(double luminance, double white, double full_well_e, Random& random) {
  if (!(full_well_e > 0)) return luminance;
  const double electrons = full_well_e * std::min(luminance / white, 1.0);
  const double sigma_e = std::sqrt(electrons + kReadNoise_e * kReadNoise_e);
  return luminance + white / full_well_e * sigma_e * random.normal();
}

Expected<FrameCamera> FrameCamera::create(const NewFolder& folder, const std::vector<float>& gain,
                                          ImageSize size, const FramesConfig& config, TimeNs end,
                                          std::uint64_t seed) {
  if (config.rate_hz > 0) {
    if (config.exposure_ms * 1e-3 * config.rate_hz > 1)
      return Error{"frames.exposure_ms",
                   text(config.exposure_ms, " ms do not fit between frames at ", config.rate_hz, " Hz"),
                   "shorten the exposure or lower frames.rate_hz"};
    if (Status made = folder.make_folder("frames"); !made) return made.error();
  }
  return FrameCamera(folder, gain, size, config, end, seed);
}

std::vector<Exposure*> FrameCamera::exposures(TimeNs t0, TimeNs t1) {
  if (config_.rate_hz > 0) {
    while (true) {
      const TimeNs open = from_seconds(started_ / config_.rate_hz),
                   close = open + from_seconds(1e-3 * config_.exposure_ms);
      if (open > t1 || close > end_) break;
      open_.push_back(
          {open, close, std::vector<float>(static_cast<std::size_t>(size_.width) * size_.height)});
      ++started_;
    }
  }
  std::vector<Exposure*> out;
  for (Exposure& exposure : open_) {
    if (exposure.open <= t1 && exposure.close >= t0) out.push_back(&exposure);
  }
  return out;
}

std::vector<std::uint8_t> FrameCamera::read_out(const Exposure& exposure) const {
  const double length_s = to_seconds(exposure.close - exposure.open);
  Random random(seed_, static_cast<std::uint64_t>(exposure.open));
  std::vector<std::uint8_t> grey(exposure.sum.size());
  for (std::size_t i = 0; i < grey.size(); ++i)
    grey[i] = grey_value(
        with_sensor_noise(gain_[i] * exposure.sum[i] / length_s, white_, config_.full_well_e, random), white_,
        config_.range_db);
  return grey;
}

Status FrameCamera::write_finished(TimeNs t) {
  while (!open_.empty() && open_.front().close <= t) {
    const Exposure& exposure = open_.front();
    if (!(white_ > 0)) {
      constexpr double kWhiteOverMedian = 6;
      std::vector<float> sorted = exposure.sum;
      const auto middle = sorted.begin() + static_cast<std::ptrdiff_t>(sorted.size() / 2);
      std::nth_element(sorted.begin(), middle, sorted.end());
      white_ = std::max(1e-6, kWhiteOverMedian * *middle / to_seconds(exposure.close - exposure.open));
    }
    const std::string name = file_name(written_++);
    if (Status done =
            write_png_grey8(folder_->path("frames/" + name), size_.width, size_.height, read_out(exposure));
        !done)
      return done;
    stamps_ +=
        text((exposure.open + exposure.close) / 2, ",", name, ",", exposure.close - exposure.open, "\n");
    open_.pop_front();
  }
  return {};
}

Status FrameCamera::finish() {
  if (!(config_.rate_hz > 0)) return {};
  return write_text_file(folder_->path("frames/timestamps.csv"),
                         "#timestamp_ns,filename,exposure_ns\n" + stamps_);
}

Status write_depth(const NewFolder& folder, const PreparedScene& prepared, const std::vector<PixelRay>& rays,
                   ImageSize size, const std::function<Pose(double t_s)>& T_map_cam,
                   const DepthConfig& config, TimeNs end, ThreadPool& pool) {
  if (!(config.rate_hz > 0)) return {};
  if (Status made = folder.make_folder("depth"); !made) return made;
  std::string stamps = "#timestamp_ns,filename\n";
  std::vector<std::uint16_t> depth_mm(rays.size());
  for (int k = 0; from_seconds(k / config.rate_hz) <= end; ++k) {
    const TimeNs t = from_seconds(k / config.rate_hz);
    const Pose pose = T_map_cam(to_seconds(t));
    const std::vector<Pose> parts = prepared.rays.parts_at(to_seconds(t));
    pool.for_chunks(rays.size(), 4096, [&](std::size_t, std::size_t begin, std::size_t stop) {
      for (std::size_t i = begin; i < stop; ++i) {
        const auto hit = prepared.rays.trace(parts, pose.p, pose.q * rays[i].direction().cast<double>());
        const double mm = hit ? 1e3 * hit->distance : 0;  // rays have z = 1
        depth_mm[i] = mm < 65535 ? static_cast<std::uint16_t>(std::lround(mm)) : std::uint16_t{0};
      }
    });
    const std::string name = file_name(k);
    if (Status done = write_png_grey16(folder.path("depth/" + name), size.width, size.height, depth_mm);
        !done)
      return done;
    stamps += text(t, ",", name, "\n");
  }
  return write_text_file(folder.path("depth/timestamps.csv"), stamps);
}

void describe(ConfigTable& table, FramesConfig& c) {
  table.add("rate_hz", c.rate_hz, "Hz", "rate of grey-level frames; 0: none", {0, 1000});
  table.add("exposure_ms", c.exposure_ms, "ms", "exposure time", {0.01, 1000});
  table.add("white_cd_m2", c.white_cd_m2, "cd/m^2",
            "luminance of white; 0: six times the median of the first frame", {0, 1e9});
  table.add("range_db", c.range_db, "dB", "dynamic range between black and white", {10, 140});
  table.add("full_well_e", c.full_well_e, "",
            "electrons at white: shot and read noise; fewer where gain makes up for light; 0: no noise",
            {0, 1e7});
}

void describe(ConfigTable& table, DepthConfig& c) {
  table.add("rate_hz", c.rate_hz, "Hz", "rate of depth images; 0: none", {0, 1000});
}

}  // namespace evpose::sim
