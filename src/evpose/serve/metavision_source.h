// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <string>

#include "evpose/camera/camera.h"
#include "evpose/core/error.h"
#include "evpose/serve/stream_queue.h"

namespace evpose {

/// Whether the words are metavision://, metavision://SERIAL, or one of these with +udp://HOST:PORT or
/// +tcp://HOST:PORT behind it.
bool is_metavision_address(const std::string& address);
/// Whether IMU samples come with it: packets of that second address, on the camera's clock.
bool metavision_address_has_imu(const std::string& address);

/// Events of a camera by the Metavision SDK; its clock starts with the camera. A camera that fails is named
/// and opened again each second. Errors: no such camera, other pixels than `size`, built without the SDK.
Expected<std::unique_ptr<Source>> open_metavision_source(const std::string& address, ImageSize size);

}  // namespace evpose
