// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/tracker/tracker.h"

#include <algorithm>
#include <utility>

#include "evpose/registration/contrast_memory.h"
#include "evpose/tracker/tracker_parts.h"

namespace evpose {
namespace {

// So often the events beside the contours count, too.
constexpr TimeNs kLookAside = 13 * kNsPerMs;

// Why an update measures nothing.
const char* const kTimeIsPast = "the time offset has changed";  // by more than an update
const char* const kAligning = "aligning the first view";

/// Before the first view is aligned again, after as many failures: each takes a fifth of a second of a core.
TimeNs pause_after(int failures) {
  constexpr int kInARow = 8;
  return failures < kInARow ? 0 : 160 * kNsPerMs;
}

/// Of segments that have offsets; 0: none have.
double offset_segment_m(const TrackerConfig& config) {
  return config.fusion.segment_offsets == SegmentOffsetUse::on ? config.fusion.segments.length_m : 0;
}

}  // namespace

double part_radius_m(const TrackerConfig& config) { return config.visible.far_m + MapPager::kMargin_m; }

Expected<std::unique_ptr<Tracker>> Tracker::create(const TrackerSetup& setup, const TrackerConfig& config,
                                                   const StartState& start, StageClock clock,
                                                   const BackEndMaker& make_fusion) {
  EVPOSE_CHECK(setup.camera != nullptr && setup.map != nullptr);
  const ContourMap& map = *setup.map;
  if (map.points.empty())
    return Error{map.source, "the map has no contour points", "give a map with contours"};
  if (auto ok = check_start(map, start, config.visible.far_m); !ok) return ok.error();
  const auto fusion = resolved(config.fusion, states_errors(map) || lens_is_guessed(setup, config.fusion));
  if (!fusion) return fusion.error();
  TrackerConfig resolved_config = config;
  resolved_config.fusion = *fusion;
  choose_states(setup, resolved_config.fusion);
  EventRegistrationConfig& registration = resolved_config.event_registration;
  registration.polarity_tells_clutter = registration.polarity && setup.motion == MotionModel::imu;
  registration.trail_filter = setup.trail_filter;
  TrackerSetup own = setup;
  std::shared_ptr<AdjustedCamera> adjusted;
  if (resolved_config.fusion.calibration.intrinsics) {
    auto made = AdjustedCamera::create(*setup.intrinsics);
    if (!made) return made.error();
    own.camera = adjusted = std::move(*made);
  }
  auto back_end =
      make_fusion ? make_fusion(resolved_config.fusion)
                  : make_back_end(setup.motion, resolved_config.fusion, setup.imu_noise, setup.T_body_cam);
  return std::unique_ptr<Tracker>(
      new Tracker(own, resolved_config, start, std::move(clock), std::move(adjusted), std::move(back_end)));
}

Tracker::Tracker(const TrackerSetup& setup, const TrackerConfig& config, const StartState& start,
                 StageClock clock, std::shared_ptr<AdjustedCamera> adjusted, std::unique_ptr<BackEnd> fusion)
    : setup_(setup),
      adjusted_(std::move(adjusted)),
      config_(config),
      T_body_cam_(setup.T_body_cam),
      map_(setup_.map, offset_segment_m(config)),
      pager_(setup_.map_parts, setup_.map_middle, config.visible.far_m, offset_segment_m(config)),
      contours_(map_.index, map_.segments, *setup_.camera, adjusted_ ? adjusted_->given() : *setup_.camera,
                T_body_cam_, visible_config(config), config.event_registration.map_sigma_m,
                config.threads > 1),
      interest_(setup_.camera->size().width, setup_.camera->size().height),
      preprocessor_(setup_.camera->size().width, setup_.camera->size().height, config.events),
      event_share_(config.events.most_mev_s),
      input_(preprocessor_, clock),
      imu_(config.imu, setup.motion),
      registration_(make_registration(config, setup_.camera->size(), *setup_.map, map_.segments)),
      frames_(make_frame_input(config, setup_, map_.segments)),
      fusion_(std::move(fusion)),
      supervisor_(relocalization_config(config), config.health,
                  Relocalizer({map_.index, map_.segments, *setup_.camera, fusion_->propagator().gravity_map(),
                               config.visible, config.event_registration, setup_.places.get()}),
                  PoseVerifier(setup_.camera->size(), told_by_flights(*setup_.map, map_.segments),
                               config.visible.occlusion && !map_.index.occluders().empty()),
                  states_errors(*setup_.map)),
      reporter_(std::move(clock)),
      start_t_(start.t),
      last_update_(start.t),
      next_update_(start.t + from_seconds(1 / config.rate_hz)),
      last_look_aside_(start.t) {
  keep_time_surface(false);
  if (follows_landmarks(setup_, config_))
    landmarks_.emplace(map_.index, *setup_.camera, T_body_cam_, adjusted_.get());
  fusion_->start(start.t, {start.T_map_body, start.velocity}, start.angular_rate_body);
  const double sigma_px = PoseUncertainty(fusion_->state(), typical_view()).separate_px();
  supervisor_.start(fusion_->state(), sigma_px);
  if (aligns_first_view(config, sigma_px))
    start_alignment_.emplace(
        RelocalizerScene{map_.index, map_.segments, *setup_.camera, fusion_->propagator().gravity_map(),
                         config.visible, config.event_registration},
        adjusted_.get());
  contours_.prepare(start.T_map_body);
  prepare_update();
}

void Tracker::add_imu(const ImuSample& sample) {
  imu_rate_output_.add(imu_.add(setup_.imu_noise.axes.corrected(sample), fusion_->state().t));
  imu_rate_output_.report_until(imu_time(next_update_), *fusion_, imu_);
  make_due_updates();
}

void Tracker::add_events(const EventPacket& packet) {
  input_.offer(packet);
  make_due_updates();
  input_.keep_rest();
}

/// True if a later event proves that all events up to t were here.
bool Tracker::feed_until(TimeNs t) {
  const bool all = input_.feed_until(t);
  if (forecast_) registration_->look_at(preprocessor_.kept(), preprocessor_.stamp(t));
  if (landmarks_) landmarks_->look_at(preprocessor_.stamp(t));
  return all;
}

void Tracker::make_due_updates() {
  while (feed_until(next_update_) &&
         (imu_.reaches(imu_time(next_update_)) || input_.newest() > next_update_ + ImuGate::kPatience))
    make_update();
}

void Tracker::events_complete_until(TimeNs t) {
  while (input_.empty() && next_update_ <= t && imu_.reaches(imu_time(next_update_))) make_update();
}

TimeNs Tracker::imu_time(TimeNs t) const { return t + from_seconds(fusion_->calibration().time_offset_s); }

void Tracker::make_update() {
  const Update result = update(next_update_);
  preprocessor_.set_motion(contours_.typical_flow_px_s());
  update_number_ += update_stride_;
  next_update_ = start_t_ + from_seconds(static_cast<double>(update_number_ + 1) / config_.rate_hz);
  if (update_callback_) update_callback_(result);
  if (setup_.motion == MotionModel::imu) {
    imu_rate_output_.restart(fusion_->reported_state(), imu_.reading());
    imu_rate_output_.report_until(imu_time(next_update_), *fusion_, imu_);
  }
  prepare_update();
}

/// The state at the next update if nothing changes.
FusionState Tracker::forecast() const {
  FusionState state = fusion_->state();
  const double dt = to_seconds(imu_time(next_update_) - state.t);
  NavState& nav = state.nav;
  nav.T_map_body = {(nav.T_map_body.q * so3::exp(dt * state.angular_rate)).normalized(),
                    nav.T_map_body.p + dt * nav.velocity};
  return state;
}

/// Once a pose is out, before the next events come: points, their bands, and where events matter.
void Tracker::prepare_update() {
  const double began_s = reporter_.now_s();
  registration_->learn(contours_.samples(), expected_span_s_);
  look_aside();
  choose_blocks();
  forecast_.reset();
  interest_.clear();
  const bool measures = !supervisor_.searching() && !start_alignment_;
  prepare_landmarks(measures);
  looks_aside_ = next_update_ >= last_look_aside_ + kLookAside;
  contours_.choose(fusion_->state().nav.T_map_body);
  page_map();
  if (update_number_ > 0 && measures) {
    const FusionState coming = forecast();
    const double span_s = to_seconds(next_update_ - last_update_);
    project_samples(coming, span_s);
    const double aside_px = looks_aside_ ? PoseVerifier::kAside_px : 0;
    if (config_.streams &&
        registration_->expect(
            {contours_.samples(), span_s, thinning_, aside_px, fusion_->measured_covariance()}, &interest_))
      forecast_ = coming.nav;
    if (forecast_) expect_landmarks(coming, span_s);
  }
  if (!forecast_) thinning_ = {};
  // Verdicts are asked for of all events; search, alignment and verification look at all of them, unless
  // there are too many.
  const bool all = !forecast_ || verdict_callback_ || (looks_aside_ && thinning_.takes_all());
  preprocessor_.set_interest(all ? nullptr : &interest_);
  near_alone_ = !all && !looks_aside_;
  expected_span_s_ = to_seconds(next_update_ - last_update_);
  reporter_.add_preparation(reporter_.now_s() - began_s);
}

/// What the events beside the contours say of the pose, of use from the next update on: it would keep the
/// pose waiting.
void Tracker::look_aside() {
  if (looks_aside_ && !supervisor_.searching())
    supervisor_.look(preprocessor_.kept(), contours_.samples(), expected_span_s_,
                     to_seconds(last_update_ - std::exchange(last_look_aside_, last_update_)), thinning_);
  preprocessor_.clear_kept();
}

/// Where events are looked at in the coming update, by how many came since the last one.
void Tracker::choose_blocks() {
  const std::int64_t near = preprocessor_.counts().near;
  if (near_alone_) event_share_.learn(near - near_seen_, expected_span_s_, thinning_.share());
  near_seen_ = near;
  thinning_ = verdict_callback_ ? BlockThinning()
                                : BlockThinning(setup_.camera->size(), event_share_.share(), update_number_);
}

Update Tracker::update(TimeNs t) {
  reporter_.begin(input_.take_feeding_time_s());
  const double span_s = to_seconds(t - std::exchange(last_update_, t));
  const TimeNs from = fusion_->state().t, until = std::max(imu_time(t), from);
  const ImuIncrement moved = imu_.predict(*fusion_, until);  // eq. (2), (4)
  search_pose(t, moved);
  see_contours(span_s);
  reporter_.end_stage(&StageTimes::predict_s);
  const bool aligning = align_start(t, moved);
  const bool measures = !supervisor_.searching() && !aligning;
  looks_aside_ &= measures;
  RegistrationResult stpe = measures ? measure(t, span_s) : RegistrationResult{};  // eq. (1)
  reporter_.end_stage(&StageTimes::register_s);
  const double innovation =
      evpose::innovation(fusion_->measured_covariance(), {stpe.information, stpe.vector});
  std::string refused = aligning ? kAligning : supervisor_.refusal(t, stpe, innovation);
  if (imu_time(t) < from) refused = kTimeIsPast;
  if (refused.empty()) fuse(stpe, registration_->offsets(), frames_ ? frames_->share_of_events() : 1);
  if (fuse_frame(t, aligning, stpe)) refused.clear();
  follow_landmarks(t, span_s, measures && refused.empty());
  if (supervisor_.initialised() && !supervisor_.searching()) imu_.compare(*fusion_);
  reporter_.add_registration(stpe, innovation, refused.empty(), thinning_.share());
  judge(t, span_s, stpe, refused);
  return reporter_.finish(fusion_->reported_state(), preprocessor_.counts());
}

/// When the pose is found, tracking begins there.
void Tracker::search_pose(TimeNs t, const ImuIncrement& moved) {
  const FusionState& state = fusion_->state();
  const auto found = supervisor_.search(
      {t, preprocessor_.stamp(t), preprocessor_.kept(), moved, state.angular_rate, T_body_cam_}, *fusion_);
  if (!found) return;
  fusion_->start(*found);
  registration_->restart();
  if (frames_) frames_->restart();
  imu_.restart_comparison();
  if (!adjusted_) start_alignment_.reset();  // the search has looked at the same events under narrower gates
  contours_.choose(found->nav.T_map_body);
}

/// While the first view is aligned, nothing else is measured.
/// True: it was so in this update.
bool Tracker::align_start(TimeNs t, const ImuIncrement& moved) {
  if (!start_alignment_ || supervisor_.searching()) return false;
  const FusionState& state = fusion_->state();
  const SeenPrior prior{state.nav, fusion_->calibration().intrinsics, fusion_->seen_covariance()};
  const bool needed = start_alignment_->expected_offset_px(prior, contours_.samples(), T_body_cam_) >
                      StartAlignment::kNeededAbove_px;
  if (!needed) {
    start_alignment_.reset();
    return false;
  }
  if (t < align_again_) return true;
  start_alignment_->add_events(preprocessor_.kept(), preprocessor_.stamp(t), moved, state.angular_rate);
  if (!start_alignment_->has_enough()) return true;
  const auto measurement = start_alignment_->align(prior, T_body_cam_);
  if (!measurement) {
    align_again_ = t + pause_after(++failed_alignments_);
    return true;
  }
  fusion_->update(*measurement);
  take_calibration();
  start_alignment_.reset();
  return true;
}

/// The camera becomes what the fusion has found it to be.
void Tracker::take_calibration() {
  const Calibration found = fusion_->calibration();
  T_body_cam_ = {found.turn * setup_.T_body_cam.q, setup_.T_body_cam.p + found.shift};
  if (adjusted_) adjusted_->set_correction(found.intrinsics);
}

RegistrationResult Tracker::measure(TimeNs t, double span_s) {
  const Matrix6d covariance = fusion_->measured_covariance();
  RegistrationProblem problem{preprocessor_.kept(), preprocessor_.stamp(t), span_s, contours_.samples(),
                              covariance};
  problem.surface = preprocessor_.surface();
  const ContourView view = contours_.view();
  problem.view = &view;
  problem.T_map_body = fusion_->state().nav.T_map_body;
  if (verdict_callback_) problem.verdicts = &verdicts_;
  problem.thinning = thinning_;
  if (forecast_) {
    const NavState& now = fusion_->state().nav;
    problem.forecast = {now.T_map_body.minus(forecast_->T_map_body), now.velocity - forecast_->velocity};
  }
  RegistrationResult result = registration_->measure(problem);
  if (verdict_callback_ && verdicts_.size() == preprocessor_.kept().size())
    verdict_callback_(preprocessor_.kept(), verdicts_);
  return result;
}

/// With a share of its information.
void Tracker::fuse(const RegistrationResult& measurement, std::span<const SampleOffset> offsets,
                   double share) {
  offsets_.clear();
  if (fusion_->takes_contours())
    for (SampleOffset offset : offsets) {
      offset.weight *= share;
      offsets_.push_back(contour_offset(offset, measurement.gate_concentration));
    }
  fusion_->update({share * measurement.information, share * measurement.vector}, offsets_);
  take_calibration();
}

void Tracker::judge(TimeNs t, double span_s, const RegistrationResult& measurement,
                    const std::string& refused) {
  const FusionState reported = fusion_->reported_state();
  const UpdateEvidence evidence{
      t, span_s, measurement, refused, fault(t, measurement), typical_view(), frames_confirm(t)};
  std::string reason;
  const Health health = supervisor_.judge(evidence, *fusion_, &reason);
  reporter_.add_judgement(health, std::move(reason), supervisor_.candidates(),
                          supervisor_.told_covariance(reported, evidence));
  reporter_.add_probability(supervisor_.probability(), supervisor_.look());
}

/// What is wrong with the data, in words; empty if nothing is.
std::string Tracker::fault(TimeNs t, const RegistrationResult& measurement) const {
  if (std::string imu = imu_.fault(t); !imu.empty()) return imu;
  if (reporter_.most_events_shed(preprocessor_.counts()))
    return "more events than are taken (events.most_mev_s)";
  if (!measurement.consistent && !frames_confirm(t)) return "events do not gather at the contours";
  return imu_.contradicts(t) ? "IMU contradicts the camera" : "";
}

}  // namespace evpose
