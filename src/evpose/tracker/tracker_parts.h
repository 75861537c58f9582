// SPDX-License-Identifier: BSD-3-Clause
// What a tracker is made of, from what it is told.
#pragma once

#include <memory>

#include "evpose/core/error.h"
#include "evpose/tracker/tracker.h"

namespace evpose {

/// Whether most contours come with an error of theirs, as in maps that are built from clouds.
bool states_errors(const ContourMap& map);

/// The temporal field has a spacing of points of its own.
VisibleSetConfig visible_config(const TrackerConfig& config);

std::unique_ptr<Registration> make_registration(const TrackerConfig& config, ImageSize size,
                                                const ContourMap& map, const ContourSegments& segments);

/// None where frames are not to be used.
std::optional<FrameInput> make_frame_input(const TrackerConfig& config, const TrackerSetup& setup,
                                           const ContourSegments& segments);

/// Whether edges that the map lacks are followed: it states errors, so that its contours may be too few or
/// wrong, and has the surfaces that such edges lie on.
bool follows_landmarks(const TrackerSetup& setup, const TrackerConfig& config);

/// The map with the signs that were learnt; null: none were.
ContourMap with_contrast(const ContourMap& map, const ContourSegments& segments,
                         const ContrastMemory* learnt);

/// Without events no pose can be searched.
RelocalizationConfig relocalization_config(const TrackerConfig& config);

/// Error: not finite, or further than `far_m` from the map.
Status check_start(const ContourMap& map, const StartState& start, double far_m);

/// What is uncertain of the calibration becomes a state. Without an IMU body and camera are one, and
/// intrinsics of which nothing is stated count as known.
void choose_states(const TrackerSetup& setup, FusionConfig& fusion);

/// Contours may lie further off at the start than the tracker's gate reaches: by the calibration, or by
/// `sigma_px` of the pose while nobody knows where it is going. After choose_states().
bool aligns_first_view(const TrackerConfig& config, double sigma_px);

/// The lens is not known well, and choose_states() leaves it out.
bool lens_is_guessed(const TrackerSetup& setup, const FusionConfig& fusion);

}  // namespace evpose
