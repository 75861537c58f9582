// SPDX-License-Identifier: BSD-3-Clause
// The source of the Metavision SDK, compiled against headers that say what the SDK's documentation says.
#include <gtest/gtest.h>

#include <metavision/sdk/stream/camera.h>

#include <mutex>
#include <thread>

#include "evpose/serve/metavision_source.h"

namespace {

/// What the camera that is not there does when it is started.
struct Script {
  std::vector<std::vector<Metavision::EventCD>> buffers;
  std::string fault;
  int opened = 0, stopped = 0;
  Metavision::EventsCDCallback events;
  Metavision::RuntimeErrorCallback failed;
};
Script script;

}  // namespace

namespace Metavision {

Camera Camera::from_first_available() {
  ++script.opened;
  return {};
}
Camera Camera::from_serial(const std::string& serial) {
  if (serial != "00042") throw CameraException("Camera not found.\nCheck it.");
  return from_first_available();
}
CallbackId CD::add_callback(const EventsCDCallback& callback) {
  script.events = callback;
  return 0;
}
CallbackId Camera::add_runtime_error_callback(RuntimeErrorCallback callback) {
  script.failed = std::move(callback);
  return 0;
}
bool Camera::start() {
  for (const auto& buffer : script.buffers) script.events(buffer.data(), buffer.data() + buffer.size());
  if (!script.fault.empty()) script.failed(CameraException(script.fault));
  return true;
}
bool Camera::stop() {
  ++script.stopped;
  return true;
}

}  // namespace Metavision

namespace evpose {
namespace {

const ImageSize kSize{64, 48};

/// Items until one is events of this base, or none comes.
std::vector<StreamItem> items_until(StreamQueue& queue, int buffers) {
  std::vector<StreamItem> items;
  StreamItem item;
  while (buffers > 0 && queue.pop(item, 20 * kNsPerS)) {
    if (item.kind == StreamItem::Kind::events) --buffers;
    items.push_back(std::move(item));
    item = {};
  }
  return items;
}

StreamQueue& waiting_queue() {
  static QueueConfig patient;
  patient.shed = false;
  static StreamQueue queue(patient);
  return queue;
}

TEST(MetavisionSource, EventsArriveAsTheyWereSentAndACameraThatFailsIsOpenedAgain) {
  script = {};
  script.buffers = {{{3, 4, 1, 1000}, {5, 6, 0, 1007}, {64, 0, 1, 1008}, {1, 1, 1, 900}}, {{7, 8, 1, 2000}}};
  script.fault = "unplugged";
  auto source = open_metavision_source("metavision://00042", kSize);
  ASSERT_TRUE(source.ok());
  StreamQueue& queue = waiting_queue();
  std::thread thread([&] { (*source)->run(queue); });
  const auto items = items_until(queue, 4);  // of two lives of the camera
  queue.close();
  thread.join();
  std::vector<const StreamItem*> events;
  std::string words;
  for (const StreamItem& item : items) {
    if (item.kind == StreamItem::Kind::events) events.push_back(&item);
    words += item.words + "\n";
  }
  ASSERT_EQ(events.size(), 4u);
  const EventPacket& first = events[0]->events;
  ASSERT_EQ(first.events.size(), 2u) << "one lies outside, one goes back in time";
  EXPECT_EQ(first.base, 1'000'000);
  EXPECT_EQ(first.events[1].dt_us, 7u);
  EXPECT_EQ(first.events[1].x, 5);
  EXPECT_EQ(first.events[1].y, 6);
  EXPECT_EQ(first.events[0].on, 1);
  EXPECT_EQ(first.events[1].on, 0);
  EXPECT_EQ(events[1]->events.base, 2'000'000);
  EXPECT_EQ(events[2]->events.base, 1'000'000) << "the clock starts with the camera";
  EXPECT_NE(words.find("the camera stopped: unplugged; opening it again"), std::string::npos);
  EXPECT_GE(script.opened, 2);
  EXPECT_GE(script.stopped, 1);
}

TEST(MetavisionSource, WhatIsWrongIsNamed) {
  script = {};
  const auto none = open_metavision_source("metavision://7", kSize);
  ASSERT_FALSE(none.ok());
  EXPECT_EQ(none.error().what, "no camera: Camera not found. Check it.");
  const auto other = open_metavision_source("metavision://", {640, 480});
  ASSERT_FALSE(other.ok());
  EXPECT_EQ(other.error().what, "the camera has 64 x 48 pixels, the calibration 640 x 480");
  EXPECT_FALSE(open_metavision_source("metavision://00042+file:///imu", kSize).ok());
  EXPECT_TRUE(metavision_address_has_imu("metavision://00042+udp://127.0.0.1:7000"));
  EXPECT_FALSE(metavision_address_has_imu("metavision://00042"));
}

}  // namespace
}  // namespace evpose
