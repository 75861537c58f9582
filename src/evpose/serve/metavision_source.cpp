// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/serve/metavision_source.h"

#include "evpose/serve/packet_source.h"

#ifdef EVPOSE_WITH_METAVISION
#include <metavision/sdk/base/events/event_cd.h>
#include <metavision/sdk/stream/camera.h>

#include <atomic>
#include <chrono>
#include <mutex>
#include <optional>
#include <thread>
#include <utility>
#endif

namespace evpose {
namespace {

constexpr std::string_view kScheme = "metavision://";

}  // namespace

bool is_metavision_address(const std::string& address) { return address.rfind(kScheme, 0) == 0; }

bool metavision_address_has_imu(const std::string& address) {
  return is_metavision_address(address) && address.find('+') != std::string::npos;
}

#ifndef EVPOSE_WITH_METAVISION

Expected<std::unique_ptr<Source>> open_metavision_source(const std::string& address, ImageSize) {
  return Error{address, "this program was built without the Metavision SDK",
               "build it where the SDK is installed (EVPOSE_METAVISION=ON), or send EVT3 packets"};
}

#else

namespace {

constexpr auto kPoll = std::chrono::milliseconds(50);  // so that a closed queue is soon noticed
constexpr auto kAgain = std::chrono::seconds(1);

Expected<Metavision::Camera> open_camera(const std::string& address, const std::string& serial,
                                         ImageSize size) {
  try {
    auto camera =
        serial.empty() ? Metavision::Camera::from_first_available() : Metavision::Camera::from_serial(serial);
    const ImageSize found{camera.geometry().get_width(), camera.geometry().get_height()};
    if (found != size)
      return Error{address,
                   text("the camera has ", found.width, " x ", found.height, " pixels, the calibration ",
                        size.width, " x ", size.height),
                   "give the calibration of this camera"};
    return camera;
  } catch (const Metavision::CameraException& fault) {
    std::string words = fault.what();
    for (char& c : words)
      if (c == '\n') c = ' ';
    return Error{address, "no camera: " + words, "check the plug and the serial number"};
  }
}

class MetavisionSource : public Source {
 public:
  MetavisionSource(std::string address, std::string serial, Metavision::Camera camera, ImageSize size)
      : address_(std::move(address)), serial_(std::move(serial)), camera_(std::move(camera)), size_(size) {}

  void run(StreamQueue& queue) override {
    while (!queue.closed()) {
      if (camera_) stream(queue);
      camera_.reset();
      for (auto waited = kPoll; waited < kAgain && !queue.closed(); waited += kPoll)
        std::this_thread::sleep_for(kPoll);
      if (queue.closed()) return;
      auto again = open_camera(address_, serial_, size_);
      if (again) camera_ = std::move(*again);
    }
  }

 private:
  /// Until the camera fails or the queue is closed.
  void stream(StreamQueue& queue) {
    last_us_ = 0;
    std::mutex mutex;
    std::string fault;
    std::atomic<bool> failed = false;
    camera_->cd().add_callback(
        [&](const Metavision::EventCD* begin, const Metavision::EventCD* end) { push(begin, end, queue); });
    camera_->add_runtime_error_callback([&](const Metavision::CameraException& e) {
      const std::lock_guard lock(mutex);
      fault = e.what();
      failed = true;
    });
    if (!camera_->start()) failed = true;
    while (!failed && !queue.closed()) std::this_thread::sleep_for(kPoll);
    camera_->stop();
    const std::lock_guard lock(mutex);
    if (failed)
      say(queue, "the camera stopped" + (fault.empty() ? fault : ": " + fault) + "; opening it again");
  }

  void push(const Metavision::EventCD* begin, const Metavision::EventCD* end, StreamQueue& queue) {
    StreamItem item;
    item.kind = StreamItem::Kind::events;
    for (const Metavision::EventCD* e = begin; e != end; ++e) {
      const std::int64_t dt_us = item.events.empty() ? 0 : e->t - item.events.base / kNsPerUs;
      if (e->x >= size_.width || e->y >= size_.height || e->t < last_us_ || dt_us > UINT32_MAX) {
        ++left_out_;
        continue;
      }
      if (item.events.empty()) item.events.base = e->t * kNsPerUs;
      last_us_ = e->t;
      item.events.events.push_back(make_event(static_cast<std::uint32_t>(dt_us), e->x, e->y, e->p > 0));
    }
    if (left_out_ > 10 * told_) {
      told_ = left_out_;
      say(queue, text(told_, " events out of order or outside of the image were left out"));
    }
    if (!item.events.empty()) queue.push(std::move(item));
  }

  static void say(StreamQueue& queue, std::string words) {
    StreamItem item;
    item.kind = StreamItem::Kind::notice;
    item.words = std::move(words);
    queue.push(std::move(item));
  }

  std::string address_, serial_;
  std::optional<Metavision::Camera> camera_;
  ImageSize size_;
  std::int64_t last_us_ = 0;
  std::uint64_t left_out_ = 0, told_ = 0;
};

/// Two sources into one queue.
class Together : public Source {
 public:
  Together(std::unique_ptr<Source> a, std::unique_ptr<Source> b) : a_(std::move(a)), b_(std::move(b)) {}

  void run(StreamQueue& queue) override {
    std::thread other([&] { b_->run(queue); });
    a_->run(queue);
    other.join();
  }

 private:
  std::unique_ptr<Source> a_, b_;
};

}  // namespace

Expected<std::unique_ptr<Source>> open_metavision_source(const std::string& address, ImageSize size) {
  const std::string rest = address.substr(kScheme.size());
  const auto plus = std::min(rest.find('+'), rest.size());
  const std::string serial = rest.substr(0, plus);
  std::unique_ptr<Source> imu;
  if (plus < rest.size()) {
    const std::string second = rest.substr(plus + 1);
    if (!is_packet_address(second))
      return Error{"'" + address + "'", "'" + second + "' is no address of packets",
                   "give metavision://SERIAL+udp://HOST:PORT"};
    auto opened = open_packet_source(second, size);
    if (!opened) return opened.error();
    imu = std::move(*opened);
  }
  auto camera = open_camera(address, serial, size);
  if (!camera) return camera.error();
  std::unique_ptr<Source> source =
      std::make_unique<MetavisionSource>(address, serial, std::move(*camera), size);
  if (!imu) return source;
  return std::unique_ptr<Source>(std::make_unique<Together>(std::move(source), std::move(imu)));
}

#endif

}  // namespace evpose
