// SPDX-License-Identifier: BSD-3-Clause
// A camera that is not there: what it sends is up to the test.
#pragma once

#include <cstddef>
#include <functional>
#include <stdexcept>
#include <string>

#include "metavision/sdk/base/events/event_cd.h"

namespace Metavision {

using CallbackId = std::size_t;
using EventsCDCallback = std::function<void(const EventCD*, const EventCD*)>;

class CameraException : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};
using RuntimeErrorCallback = std::function<void(const CameraException&)>;

class I_Geometry {
 public:
  int get_width() const { return 64; }
  int get_height() const { return 48; }
};

class CD {
 public:
  CallbackId add_callback(const EventsCDCallback& callback);
};

/// Moved, not copied, like the real one.
class Camera {
 public:
  static Camera from_first_available();
  static Camera from_serial(const std::string& serial);
  Camera(Camera&&) = default;
  Camera& operator=(Camera&&) = default;
  Camera(const Camera&) = delete;
  Camera& operator=(const Camera&) = delete;

  CD& cd() { return cd_; }
  const I_Geometry& geometry() const { return geometry_; }
  CallbackId add_runtime_error_callback(RuntimeErrorCallback callback);
  bool start();
  bool stop();

 private:
  Camera() = default;
  CD cd_;
  I_Geometry geometry_;
};

}  // namespace Metavision
