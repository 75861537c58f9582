// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/io/recording/turn_of_events.h"

#include <gtest/gtest.h>

#include <random>

#include "evpose/core/pose.h"
#include "evpose/io/motion/imu_axes.h"

namespace evpose {
namespace {

const CameraIntrinsics kCamera{180, 180, 119.5, 89.5, "none", {}, {240, 180}};
constexpr double kStep_s = 1e-3, kDuration_s = 1.5;

/// The camera looks along the body's x; y is left, z up.
Eigen::Matrix3d R_cam_imu() { return (Eigen::Matrix3d() << 0, -1, 0, 0, 0, -1, 1, 0, 0).finished(); }

Eigen::Vector3d rate_at(double t_s) {
  return {1.5 * std::sin(5 * t_s), 2 * std::sin(7 * t_s + 1), 2.5 * std::sin(4 * t_s + 2)};
}

/// Far points about the camera, an event wherever one of them comes to another pixel.
class Stars final : public EventReader {
 public:
  /// `turning`: else the camera stays and events come anywhere.
  explicit Stars(bool turning) : camera_(*make_camera(kCamera)), turning_(turning) {
    std::normal_distribution<double> normal;
    for (int i = 0; i < 9000; ++i) {
      const double x = normal(random_), y = normal(random_), z = normal(random_);
      stars_.push_back(Eigen::Vector3d(x, y, z).normalized());
    }
    seen_.resize(stars_.size(), Eigen::Vector2i(-1, -1));
  }
  Expected<bool> next(EventPacket& packet) override {
    packet.events.clear();
    packet.base = from_seconds(t_s_);
    std::uniform_int_distribution<int> column(0, 239), row(0, 179);
    while (packet.events.empty() && t_s_ < kDuration_s) {
      packet.base = from_seconds(t_s_);
      for (std::size_t i = 0; i < stars_.size(); ++i) {
        const auto pixel = camera_->project(R_cam_imu() * (q_.conjugate() * stars_[i]));
        if (!pixel || !camera_->size().contains(*pixel)) continue;
        const Eigen::Vector2i here = pixel->array().round().cast<int>();
        const bool moved = here != seen_[i] && seen_[i].x() >= 0;
        seen_[i] = here;
        if (turning_ && moved) packet.events.push_back(make_event(0, here.x(), here.y(), true));
        if (!turning_ && i % 16 == 0)
          packet.events.push_back(make_event(0, column(random_), row(random_), true));
      }
      q_ = (q_ * so3::exp(kStep_s * rate_at(t_s_ + 0.5 * kStep_s))).normalized();
      t_s_ += kStep_s;
    }
    return !packet.events.empty();
  }
  ImageSize size() const override { return camera_->size(); }
  EventExtent extent() const override { return {}; }

 private:
  std::shared_ptr<const Camera> camera_;
  bool turning_;
  std::mt19937 random_{5};
  std::vector<Eigen::Vector3d> stars_;
  std::vector<Eigen::Vector2i> seen_;
  Eigen::Quaterniond q_ = Eigen::Quaterniond::Identity();
  double t_s_ = 0;
};

/// What is said if the axes are `of_read` times the true ones; empty: nothing.
std::string said(const Eigen::Matrix3d& of_read, bool turning = true) {
  std::vector<ImuSample> samples;
  for (double t_s = 0; t_s < kDuration_s; t_s += 5e-3) {
    samples.push_back({});
    samples.back().t = from_seconds(t_s);
    samples.back().gyro = of_read * rate_at(t_s);
  }
  Stars stars(turning);
  const auto doubt = doubt_gyro_by_events(stars, **make_camera(kCamera), R_cam_imu(), samples, "imu.csv");
  EXPECT_TRUE(doubt.ok());
  return doubt && *doubt ? (*doubt)->line() : "";
}

TEST(TurnOfEvents, NamesTheAxesThatMakeASharpPicture) {
  EXPECT_EQ(said(Eigen::Matrix3d::Identity()), "");
  const AxisNames swapped = (AxisNames() << 0, 1, 0, 1, 0, 0, 0, 0, 1).finished();
  const AxisNames turned = (AxisNames() << 0, 0, 1, -1, 0, 0, 0, -1, 0).finished();
  const AxisNames mirrored = Eigen::Vector3d(1, 1, -1).asDiagonal();
  for (const AxisNames& names : {swapped, turned, mirrored}) {
    const std::string line = said(names.transpose());
    EXPECT_NE(line.find(in_words(names)), std::string::npos) << line;
  }
}

TEST(TurnOfEvents, SaysNothingWhereNothingTurns) {
  EXPECT_EQ(said((AxisNames() << 0, 1, 0, 1, 0, 0, 0, 0, 1).finished(), false), "");
  EXPECT_EQ(said(Eigen::Matrix3d::Zero()), "");
}

}  // namespace
}  // namespace evpose
