// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/tracker/tracker.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

#include "evpose/core/config.h"

namespace evpose {
namespace {

double distance_outside(const ContourMap& map, const Eigen::Vector3d& p) {
  Eigen::Vector3f low = map.points.front().position, high = low;
  for (const auto& q : map.points) low = low.cwiseMin(q.position), high = high.cwiseMax(q.position);
  const Eigen::Vector3d relative = p - map.anchor;
  return (low.cast<double>() - relative).cwiseMax(relative - high.cast<double>()).cwiseMax(0).norm();
}

/// As maps that are built from clouds do.
bool states_errors(const ContourMap& map) {
  const auto counts = [](const ContourPoint& point) { return !is_view_dependent(point.kind); };
  const auto states = [](const ContourPoint& point) {
    return !is_view_dependent(point.kind) && point.sigma > 0;
  };
  const auto& points = map.points;
  return 2 * std::count_if(points.begin(), points.end(), states) >
         std::count_if(points.begin(), points.end(), counts);
}

/// Each field has its own choice of points.
VisibleSetConfig spread(const TrackerConfig& config) {
  VisibleSetConfig out = config.visible;
  if (config.field == FieldKind::exponential) out.stride_px = config.exponential.stride_px;
  return out;
}

/// An IMU that is silent for longer is not waited for.
constexpr TimeNs kImuPatience = 50 * kNsPerMs;

/// If no sample is near after t, puts one at t that repeats the last reading, to be distrusted. True if so.
/// Which samples have arrived beyond the patience makes no difference.
bool bridge(std::deque<CheckedImu>& imu, TimeNs t, const FusionState& state,
            const Eigen::Vector3d& gravity_map) {
  const auto next =
      std::find_if(imu.begin(), imu.end(), [t](const CheckedImu& s) { return s.sample.t >= t; });
  if (next != imu.end() && next->sample.t <= t + kImuPatience) return false;
  CheckedImu held;
  if (next == imu.begin())
    held.sample = {t, state.gyro_bias, state.accel_bias - state.nav.T_map_body.q.conjugate() * gravity_map};
  else
    held = *(next - 1);
  held.sample.t = t;
  held.missing = true;
  imu.insert(next, held);
  return true;
}

double median(std::vector<double>& values) {
  if (values.empty()) return 0;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

}  // namespace

void describe(ConfigTable& table, TrackerConfig& c) {
  table.add("rate_hz", c.rate_hz, "Hz", "updates per second of data time", {1, 5000});
  table.add("threads", c.threads, "",
            "threads: from two on, one chooses the points; the result is the same for any number", {1, 64});
  table.group("events", c.events);
  table.group("visible", c.visible);
  table.add("field", c.field, {{"events", FieldKind::events}, {"exponential", FieldKind::exponential}},
            "each event once against the moving contours, or the paper's temporal distance field");
  table.group("alignment", c.alignment);
  table.group("exponential", c.exponential);
  table.group("fusion", c.fusion);
  table.group("imu", c.imu);
  table.group("agreement", c.agreement);
  table.group("relocalization", c.relocalization);
  table.group("health", c.health);
}

Expected<std::unique_ptr<Tracker>> Tracker::create(const TrackerSetup& setup, const TrackerConfig& config,
                                                   const StartState& start, StageClock clock) {
  EVPOSE_CHECK(setup.camera != nullptr && setup.map != nullptr);
  const ContourMap& map = *setup.map;
  if (map.points.empty())
    return Error{map.source, "the map has no contour points", "give a map with contours"};
  if (!start.T_map_body.p.allFinite() || !start.T_map_body.q.coeffs().allFinite() ||
      !start.velocity.allFinite())
    return Error{"start pose", "not finite", "check --init"};
  const double outside = distance_outside(map, start.T_map_body.p);
  if (outside > config.visible.far_m)
    return Error{"start pose",
                 text("(", start.T_map_body.p.x(), ", ", start.T_map_body.p.y(), ", ", start.T_map_body.p.z(),
                      ") m is ", outside, " m off the map, which is seen up to ", config.visible.far_m, " m"),
                 "check that map and start pose share one frame (frames.T_map_world in recording.yaml)"};
  TrackerConfig settled_config = config;
  const auto pieces = settled(config.fusion, states_errors(map));
  if (!pieces) return pieces.error();
  settled_config.fusion.slow.piece_offset = *pieces;
  return std::unique_ptr<Tracker>(new Tracker(setup, settled_config, start, std::move(clock)));
}

Tracker::Tracker(const TrackerSetup& setup, const TrackerConfig& config, const StartState& start,
                 StageClock clock)
    : setup_(setup),
      config_(config),
      clock_(std::move(clock)),
      pool_(config.threads),
      index_(*setup_.map),
      visible_(index_, *setup_.camera, spread(config), config.threads > 1),
      front_(setup_.camera->size().width, setup_.camera->size().height, config.events),
      fusion_(make_back_end(setup.motion, config.fusion, setup.imu_noise, setup.T_body_cam)),
      relocalizer_({index_, pieces_, *setup_.camera, fusion_->propagator().gravity_map(), config.visible,
                    config.alignment}),
      health_(config.health),
      imu_watch_(config.imu),
      agreement_(config.agreement),
      given_T_body_cam_(setup.T_body_cam),
      start_t_(start.t),
      last_update_(start.t),
      pieces_(cut_into_segments(*setup_.map)),
      alignment_(setup_.camera->size(), config.alignment, pieces_.count) {
  if (config.fusion.slow.piece_offset == PieceOffsets::on)
    offset_pieces_ = cut_into_segments(*setup_.map, config.fusion.slow.piece_m).of_point;
  fusion_->start(start.t, {start.T_map_body, start.velocity}, start.angular_rate_body);
  health_.start(start.t);
  before_search_ = fusion_->state();
  if (config.relocalization.on && sigma_px() > Relocalizer::kSearchAboveSigma_px)
    relocalizer_.begin_search(start.t, fusion_->state().nav, fusion_->state().pose_covariance());
  next_update_ = start_t_ + from_seconds(1 / config_.rate_hz);
  visible_.choose(start.T_map_body * setup_.T_body_cam);  // the dearest one, before the data come
}

void Tracker::add_imu(const ImuSample& sample) {
  if (setup_.motion != MotionModel::imu) return;
  for (const CheckedImu& checked : imu_watch_.take(sample)) {
    if (!imu_.empty() && checked.sample.t <= imu_.back().sample.t) continue;
    imu_.push_back(checked);
    if (state_callback_) to_tell_.push_back(checked);
  }
  // Before the start only the last sample matters.
  while (imu_.size() >= 2 && imu_[1].sample.t <= fusion_->state().t) imu_.pop_front();
  tell_states();
  pump();
}

void Tracker::add_events(const EventPacket& packet) {
  std::size_t from = 0;
  if (waiting_.empty()) consume(packet, &from);
  if (from == packet.events.size()) return;
  waiting_.push_back(
      {packet.base, {packet.events.begin() + static_cast<std::ptrdiff_t>(from), packet.events.end()}});
}

void Tracker::pump() {
  while (!waiting_.empty()) {
    consume(waiting_.front(), &waiting_from_);
    if (waiting_from_ < waiting_.front().events.size()) return;
    waiting_.pop_front();
    waiting_from_ = 0;
  }
}

std::size_t Tracker::feed(const EventPacket& packet, std::size_t from, TimeNs until) {
  const auto begin = packet.events.begin() + static_cast<std::ptrdiff_t>(from);
  const auto end = std::upper_bound(begin, packet.events.end(), until,
                                    [&](TimeNs t, const Event& e) { return t < packet.time(e); });
  const double t0 = now();
  front_.take(packet, {begin, end});
  events_time_s_ += now() - t0;
  return static_cast<std::size_t>(end - begin);
}

void Tracker::consume(const EventPacket& packet, std::size_t* from) {
  while (*from < packet.events.size()) {
    // An event after the update's time proves that all events up to it are here.
    *from += feed(packet, *from, next_update_);
    if (*from == packet.events.size()) return;
    const EventPacket& newest = waiting_.empty() ? packet : waiting_.back();
    const bool overdue = newest.time(newest.events.back()) > next_update_ + kImuPatience;
    if (!imu_reaches(imu_time(next_update_)) && !overdue) return;
    make_update();
  }
}

TimeNs Tracker::imu_time(TimeNs t) const { return t + from_seconds(fusion_->calibration().time_offset_s); }

bool Tracker::imu_reaches(TimeNs t) const {
  return setup_.motion != MotionModel::imu || (!imu_.empty() && imu_.back().sample.t >= t);
}

void Tracker::make_update() {
  const Update result = update(next_update_);
  update_number_ += update_stride_;
  next_update_ = start_t_ + from_seconds(static_cast<double>(update_number_ + 1) / config_.rate_hz);
  if (callback_) callback_(result);
  if (!state_callback_ || setup_.motion != MotionModel::imu) return;
  ahead_ = fusion_->state();
  told_ = imu_.front().sample;
  tell_states();
}

void Tracker::events_complete_until(TimeNs t) {
  while (waiting_.empty() && next_update_ <= t && imu_reaches(imu_time(next_update_))) make_update();
}

void Tracker::tell_states() {
  while (!to_tell_.empty() && to_tell_.front().sample.t < imu_time(next_update_)) {
    const CheckedImu& next = to_tell_.front();
    if (update_number_ > 0 && next.sample.t > ahead_.t) {
      const TimeNs t = fusion_->state().t;
      const bool held = agreement_.distrusted(t);
      fusion_->propagator().propagate(ahead_, held ? held_reading(told_.t, ahead_) : told_,
                                      held ? held_reading(next.sample.t, ahead_) : next.sample,
                                      trust_in(next, next, t));
      told_ = next.sample;
      state_callback_(ahead_);
    }
    to_tell_.pop_front();
  }
}

/// Whether the IMU is silent up to this time. While it is, or is not relied on, the gyroscope's bias stands
/// for the rate that a held reading does not know; afterwards both biases are what they were.
bool Tracker::bridge_silence(TimeNs until) {
  if (setup_.motion != MotionModel::imu) return false;
  const bool silent = bridge(imu_, until, fusion_->state(), fusion_->propagator().gravity_map());
  const bool blind = silent || agreement_.distrusted(until);
  if (blind && !blind_) {
    before_blind_ = fusion_->state();
    held_gyro_ = before_blind_.angular_rate + before_blind_.gyro_bias;
  }
  if (!blind && blind_) {
    fusion_->start(with_imu_biases());
    if (imu_.size() >= 2 && imu_[0].missing) {
      imu_[0] = {{imu_[0].sample.t, imu_[1].sample.gyro, imu_[1].sample.accel}, true, imu_[1].doubted, false};
    }
  }
  blind_ = blind;
  return silent;
}

/// The newest state with the biases of the IMU itself, known as well as before it was silent or distrusted.
FusionState Tracker::with_imu_biases() const {
  FusionState state = fusion_->state();
  if (!blind_) return state;
  state.gyro_bias = before_blind_.gyro_bias;
  state.accel_bias = before_blind_.accel_bias;
  state.covariance.rightCols<6>().setZero();
  state.covariance.bottomRows<6>().setZero();
  state.covariance.bottomRightCorner<6, 6>() = before_blind_.covariance.bottomRightCorner<6, 6>();
  return state;
}

/// A reading of a body that keeps its velocity and its rate, in place of one that is wrong.
ImuSample Tracker::held_reading(TimeNs t, const FusionState& state) const {
  return {t, held_gyro_,
          state.accel_bias - state.nav.T_map_body.q.conjugate() * fusion_->propagator().gravity_map()};
}

ImuTrust Tracker::trust_in(const CheckedImu& a, const CheckedImu& b, TimeNs t) const {
  if (a.missing || b.missing || agreement_.distrusted(t)) return ImuTrust::none;
  return a.suspect || b.suspect || a.doubted || b.doubted ? ImuTrust::suspect : ImuTrust::good;
}

void Tracker::predict(TimeNs t) {
  const TimeNs from = fusion_->state().t;
  moved_ = {};
  if (setup_.motion == MotionModel::constant_velocity) {
    moved_.dt_s = to_seconds(t - from);
    return fusion_->predict(t);
  }
  // Make the first sample stand at the state's time, then step from sample to sample; the last step ends at
  // t.
  if (t == from) return;
  if (imu_.front().sample.t > from) {
    CheckedImu first = imu_.front();
    first.sample.t = from;
    imu_.push_front(first);
  }
  while (imu_.size() >= 2 && imu_[1].sample.t <= from) imu_.pop_front();
  if (imu_.front().sample.t < from)
    imu_.front().sample = interpolate(imu_.front().sample, imu_[1].sample, from);
  const auto step = [this, t](const CheckedImu& a, const CheckedImu& b) {
    const FusionState& state = fusion_->state();
    const ImuTrust reading = a.missing || b.missing   ? ImuTrust::none
                             : a.suspect || b.suspect ? ImuTrust::suspect
                                                      : ImuTrust::good;
    agreement_.step(a.sample, b.sample, with_imu_biases(), fusion_->propagator().gravity_map(),
                    fusion_->propagator().noise_at(b.sample.gyro, b.sample.accel, reading));
    if (relocalizer_.searching() || verify_until_ != 0)
      moved_ = joined(moved_, integrate(a.sample, b.sample, state.gyro_bias, state.accel_bias));
    if (agreement_.distrusted(t))
      fusion_->predict(held_reading(a.sample.t, state), held_reading(b.sample.t, state), ImuTrust::none);
    else
      fusion_->predict(a.sample, b.sample, trust_in(a, b, t));
  };
  while (imu_[1].sample.t < t) {
    step(imu_[0], imu_[1]);
    imu_.pop_front();
  }
  const CheckedImu last{interpolate(imu_[0].sample, imu_[1].sample, t), imu_[1].suspect, imu_[1].doubted,
                        imu_[1].missing};
  step(imu_[0], last);
  imu_.front() = last;
}

/// Uncertainty of the pose as image motion of the typical point, 1 sigma, in the weakest direction.
double Tracker::sigma_px() const {
  const Matrix6d covariance = fusion_->state().pose_covariance();
  const auto largest = [](const Eigen::Matrix3d& m) {
    return std::sqrt(
        std::max(0.0, Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(m).eigenvalues().maxCoeff()));
  };
  return setup_.camera->focal_px() * std::max(largest(covariance.topLeftCorner<3, 3>()) / typical_depth_m_,
                                              largest(covariance.bottomRightCorner<3, 3>()));
}

/// The direction of sigma_px(), in words.
std::string Tracker::weakest_direction() const {
  const Matrix6d covariance = fusion_->state().pose_covariance();
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> position(covariance.topLeftCorner<3, 3>()),
      rotation(covariance.bottomRightCorner<3, 3>());
  const bool turns =
      rotation.eigenvalues()[2] * typical_depth_m_ * typical_depth_m_ > position.eigenvalues()[2];
  const Eigen::Vector3d axis = turns ? fusion_->state().nav.T_map_body.q * rotation.eigenvectors().col(2)
                                     : Eigen::Vector3d(position.eigenvectors().col(2));
  const auto digits = [](double v) { return std::round(100 * v) / 100 + 0.0; };
  return text(turns ? "rotation about (" : "position along (", digits(axis.x()), ", ", digits(axis.y()), ", ",
              digits(axis.z()), ") of the map");
}

/// One update's part of the search for the pose; when it is found, tracking begins there.
void Tracker::search(TimeNs t) {
  const auto found = relocalizer_.process(
      {t, front_.stamp(t), front_.kept(), moved_, fusion_->state().angular_rate, setup_.T_body_cam});
  if (!found) return;
  FusionState state =
      fusion_->propagator().initial_state(fusion_->state().t, found->nav, found->angular_rate);
  state.gyro_bias = fusion_->state().gyro_bias;
  state.accel_bias = fusion_->state().accel_bias;
  if (setup_.motion == MotionModel::constant_velocity) state.gyro_bias = -found->angular_rate;
  const auto widen = [&state](int at, double sigma) {
    state.covariance.diagonal().segment<3>(at).setConstant(sigma * sigma);
  };
  widen(error_state::kP, Relocalizer::kFoundPositionSigma_m);
  widen(error_state::kPhi, Relocalizer::kFoundRotationSigma_rad);
  widen(error_state::kV, Relocalizer::kFoundVelocitySigma_m_s);
  fusion_->start(state);
  alignment_.forget();
  agreement_.forget();
  verify_until_ = t + from_seconds(Relocalizer::kVerify_s);
}

double Tracker::plan_points(const Pose& T_map_body, double span_s) {
  const FusionState& state = fusion_->state();
  const auto& chosen = visible_.choose(T_map_body * setup_.T_body_cam);
  const ContourView view{*setup_.map, pieces_, *setup_.camera, setup_.T_body_cam,
                         config_.alignment.map_sigma_m};
  const BodyMotion motion{T_map_body, state.nav.velocity, state.angular_rate};
  project_contours(view, chosen, motion, span_s, samples_);
  const Eigen::Matrix3d velocity_covariance = state.covariance.block<3, 3>(error_state::kV, error_state::kV);
  const double rate_variance = state.covariance.block<3, 3>(error_state::kBg, error_state::kBg).trace() / 3;
  points_.clear();
  flows_.clear();
  depths_.clear();
  for (ContourSample& s : samples_) {
    const Eigen::Vector3d by_position = s.jacobian.head<3>();
    s.speed_sigma_px_s = std::sqrt(std::max(0.0, by_position.dot(velocity_covariance * by_position) +
                                                     rate_variance * s.jacobian.tail<3>().squaredNorm()));
    if (config_.field == FieldKind::exponential) {
      const RegistrationConfig& c = config_.exponential;
      const double decay_s = std::clamp(c.decay_px / std::max(std::abs(s.speed_px_s), 1e-9), c.decay_min_s,
                                        std::max(c.decay_min_s, c.decay_max_s));
      points_.push_back({setup_.map->position(s.point), 1e6 * decay_s});
    }
    flows_.push_back(s.flow_px_s);
    depths_.push_back(s.depth_m);
  }
  if (!depths_.empty()) typical_depth_m_ = median(depths_);
  return median(flows_);
}

Tracker::Registration Tracker::register_events(TimeNs t, const Pose& predicted, double span_s) {
  const Matrix6d covariance = fusion_->measured_covariance();
  if (config_.field == FieldKind::events) {
    const EventAlignmentResult r =
        alignment_.align({front_.kept(), front_.stamp(t), span_s, samples_, covariance, &front_.surface(),
                          verdict_callback_ ? &verdicts_ : nullptr});
    if (verdict_callback_) verdict_callback_(front_.kept(), verdicts_);
    contours_.clear();
    if (fusion_->takes_contours())
      for (const SampleOffset& offset : alignment_.offsets()) {
        const ContourSample& s = samples_[offset.sample];
        contours_.push_back(
            {predicted.inverse() * setup_.map->position(s.point),
             predicted.q.conjugate() * Eigen::Vector3d(s.jacobian.head<3>()), offset.offset_px, offset.weight,
             offset_pieces_.empty() ? s.piece : offset_pieces_[s.point], setup_.map->points[s.point].sigma});
      }
    return {{r.information, r.vector},
            static_cast<int>(samples_.size()),
            r.matched_samples,
            std::sqrt(r.mean_square_px2),
            r.matched_events,
            r.wrong_polarity,
            r.other_motion,
            r.captured,
            r.slope};
  }
  const Matrix6d prior = covariance.ldlt().solve(Matrix6d::Identity());
  const AlignmentProblem problem{
      front_.surface(), *setup_.camera, setup_.T_body_cam, points_, front_.stamp(t), predicted, prior};
  const AlignmentResult r = align(problem, config_.exponential, pool_);
  return {{r.information, r.vector}, r.seen, r.matched, std::sqrt(r.cost)};
}

std::string Tracker::refusal(const Registration& r, double innovation) const {
  const HealthConfig& h = config_.health;
  if (r.points == 0) return "no map point in view";
  if (r.matched < h.least_points)
    return text("only ", r.matched, " of ", r.points, " map points have events near by");
  if (!(innovation <= h.gate)) return "registration contradicts the prediction";
  return "";
}

Update Tracker::update(TimeNs t) {
  Update out;
  out.t = t;
  const double span_s = to_seconds(t - last_update_);
  last_update_ = t;
  const double t0 = now();
  // When the time offset found has fallen by more than an update, this update's time is past.
  const bool past = imu_time(t) < fusion_->state().t;
  const TimeNs until = past ? fusion_->state().t : imu_time(t);
  const bool blind = bridge_silence(until);
  predict(until);
  if (relocalizer_.searching())
    search(t);
  else if (verify_until_ != 0)
    relocalizer_.add_motion(moved_);
  const Pose predicted = fusion_->state().nav.T_map_body;
  const double t1 = now();

  const double flow_px_s = plan_points(predicted, span_s);
  const double t2 = now();

  const bool searching = relocalizer_.searching();
  const Registration stpe = searching ? Registration{} : register_events(t, predicted, span_s);
  const double t3 = now();

  Evidence evidence;
  evidence.t = t;
  out.innovation = innovation(fusion_->measured_covariance(), stpe.measurement);
  // A pose that was found is believed once its events have gathered at the contours for a while.
  const bool watched = verify_until_ != 0,
             refuted = watched && t >= verify_until_ && stpe.slope < Relocalizer::kLowConcentration;
  evidence.searching = searching || t < verify_until_ || refuted;
  evidence.refused = searching || refuted ? "searching for the pose"
                     : past               ? "the time offset has changed"
                                          : refusal(stpe, out.innovation);
  evidence.accepted = evidence.refused.empty();
  evidence.fault = blind ? "no IMU samples" : imu_watch_.fault(t);
  if (evidence.fault.empty() &&
      2 * (front_.counts().shed - counted_.shed) > front_.counts().read - counted_.read)
    evidence.fault = "more events than are taken (events.most_mev_s)";
  if (evidence.fault.empty() && !stpe.captured) evidence.fault = "events do not gather at the contours";
  if (evidence.accepted) fusion_->update(stpe.measurement, contours_);  // eq. (5) for the newest state
  const Calibration found = fusion_->calibration();
  setup_.T_body_cam = {found.turn * given_T_body_cam_.q, given_T_body_cam_.p + found.shift};

  // At first the estimate is that of the start, not yet that of the contours.
  const bool settled = health_.state() != Health::waiting && health_.state() != Health::initialising;
  if (setup_.motion == MotionModel::imu && !searching && settled)
    agreement_.judge(with_imu_biases(), imu_.front().doubted);
  if (evidence.fault.empty() && agreement_.distrusted(t)) evidence.fault = "IMU contradicts the camera";

  const Matrix6d covariance = fusion_->state().pose_covariance();
  evidence.sigma_px = sigma_px();
  if (evidence.sigma_px > config_.health.degraded_sigma_px) evidence.weakest = weakest_direction();
  out.health = health_.judge(evidence, &out.reason);
  const bool astray = !stpe.captured || (out.health == Health::lost && verify_until_ == 0);
  astray_s_ = astray ? astray_s_ + span_s : 0;
  if (watched && t >= verify_until_) verify_until_ = 0;
  if (refuted) {
    // What a wrong pose has taught goes with it.
    FusionState state = fusion_->state();
    state.gyro_bias = before_search_.gyro_bias;
    state.accel_bias = before_search_.accel_bias;
    fusion_->start(state);
    relocalizer_.restart_search(t);
  }
  if (config_.relocalization.on && !relocalizer_.searching() &&
      astray_s_ > config_.relocalization.patience_s) {
    Matrix6d around = covariance;
    around.diagonal().head<3>().array() += std::pow(config_.relocalization.position_sigma_m, 2);
    around.diagonal().tail<3>().array() += std::pow(config_.relocalization.rotation_sigma_rad, 2);
    before_search_ = fusion_->state();
    relocalizer_.begin_search(t, fusion_->state().nav, around);
    astray_s_ = 0;
  }

  const FusionState& state = fusion_->state();
  out.t = state.t;
  out.T_map_body = state.nav.T_map_body;
  out.velocity = state.nav.velocity;
  out.gyro_bias = state.gyro_bias;
  out.accel_bias = state.accel_bias;
  out.angular_rate = fusion_->state().angular_rate;
  out.covariance = covariance;
  out.velocity_covariance = state.covariance.block<3, 3>(6, 6);
  out.accepted = evidence.accepted;
  out.events_read = static_cast<std::int32_t>(front_.counts().read - counted_.read);
  out.events_shed = static_cast<std::int32_t>(front_.counts().shed - counted_.shed);
  out.events_kept = static_cast<std::int32_t>(front_.counts().kept - counted_.kept);
  out.points = stpe.points;
  out.points_matched = stpe.matched;
  out.residual = stpe.residual;
  out.events_matched = stpe.events;
  out.wrong_polarity = stpe.wrong_polarity;
  out.other_motion = stpe.other_motion;
  out.times = {events_time_s_, t1 - t0, t2 - t1, t3 - t2, now() - t3};
  counted_ = front_.counts();
  events_time_s_ = 0;
  front_.set_motion(flow_px_s);
  front_.forget();
  return out;
}

Tracker::Snapshot Tracker::snapshot(double decay_s) const {
  Snapshot out;
  const TimeSurface& surface = front_.surface();
  const std::uint32_t now_us = front_.stamp(fusion_->state().t);
  out.size = setup_.camera->size();
  out.decay.reserve(static_cast<std::size_t>(surface.width()) * static_cast<std::size_t>(surface.height()));
  for (int y = 0; y < surface.height(); ++y)
    for (int x = 0; x < surface.width(); ++x) {
      const std::uint32_t on = surface.last(x, y, Polarity::on), off = surface.last(x, y, Polarity::off);
      const std::uint32_t last = std::max(on, off);
      const double age_s = 1e-6 * (now_us > last ? now_us - last : 0);
      const auto value = static_cast<float>(last == 0 ? 0 : std::exp(-age_s / decay_s));
      out.decay.push_back(on >= off ? value : -value);
    }
  out.points = chosen_points(decay_s);
  return out;
}

std::vector<Tracker::Snapshot::Point> Tracker::chosen_points(double decay_s) const {
  std::vector<Snapshot::Point> out;
  const TimeSurface& surface = front_.surface();
  const Pose T_map_body = fusion_->state().nav.T_map_body;
  const std::uint32_t now_us = front_.stamp(fusion_->state().t);
  const ImageSize size = setup_.camera->size();
  const Pose T_cam_map = (T_map_body * setup_.T_body_cam).inverse();
  const double decay_us = 1e6 * decay_s;
  for (const std::uint32_t i : visible_.chosen()) {
    const auto pixel = setup_.camera->project(T_cam_map * setup_.map->position(i));
    if (!pixel || !size.contains(*pixel)) continue;
    const double field = sample_field(surface, *pixel, now_us, decay_us, FieldKernel::bilinear).value;
    out.push_back({static_cast<float>(pixel->x()), static_cast<float>(pixel->y()), field >= 0.3679});
  }
  return out;
}

}  // namespace evpose
