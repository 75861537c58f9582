// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/io/events/events_aedat4.h"

#include <algorithm>
#include <numbers>

#include "evpose/io/events/aedat4_file.h"
#include "evpose/io/events/event_packer.h"
#include "evpose/io/events/event_source.h"

namespace evpose {
namespace {

constexpr std::size_t kEventBytes = 16;
constexpr double kStandardGravity = 9.80665;
constexpr double kRadians = std::numbers::pi / 180;

Error no_stream(const std::string& path, const std::string& name) {
  return Error{path, name.empty() ? "has no stream of events" : "has no stream of events numbered " + name,
               "see the streams by `evpose info`"};
}

class Aedat4Source : public EventSource {
 public:
  static Expected<std::unique_ptr<EventSource>> open(const std::string& path, const std::string& number) {
    auto file = Aedat4File::open(path);
    if (!file) return file.error();
    const Aedat4Stream* stream = file->find("EVTS", number);
    if (stream == nullptr) return no_stream(path, number);
    const int id = stream->id;
    return std::unique_ptr<EventSource>(new Aedat4Source(*std::move(file), id));
  }

  Expected<bool> fetch(EventBlock& block) override {
    block.start();
    while (events_.empty()) {
      if (!file_.next()) return false;
      if (file_.stream() != id_) continue;
      const auto packet = file_.message("EVTS");
      if (!packet) return packet.error();
      if (const auto events = packet->vector(0, kEventBytes)) events_ = events->bytes();
    }
    return unpack(block);
  }

  void finish() const override { file_.warn_if_cut(); }

 private:
  Aedat4Source(Aedat4File file, int id) : file_(std::move(file)), id_(id) {}

  Expected<bool> unpack(EventBlock& block) {
    const std::size_t count = std::min(events_.size() / kEventBytes, block.events.size());
    block.base_us = load<std::int64_t>(events_);
    std::size_t i = 0;
    for (; i < count; ++i) {
      const std::size_t at = i * kEventBytes;
      const auto t = load<std::int64_t>(events_, at);
      const auto x = load<std::int16_t>(events_, at + 8), y = load<std::int16_t>(events_, at + 10);
      if (t < -kLargestTimeUs || t > kLargestTimeUs || x < 0 || y < 0)
        return Error{file_.path(),
                     text("event ", block.first_row + static_cast<std::int64_t>(i), " (from 0): (", x, ", ",
                          y, ") at ", t, " us cannot be"),
                     "the file is damaged; copy it again"};
      const std::int64_t dt = t - block.base_us;
      if (dt < 0 || dt > UINT32_MAX) break;  // the packer judges the first of a block by its own time
      const auto on = std::to_integer<std::uint64_t>(events_[at + 12]) != 0 ? 1u : 0u;
      block.events[i] = event_of_bits(event_bits(
          static_cast<std::uint32_t>(dt), static_cast<std::uint64_t>(x), static_cast<std::uint64_t>(y), on));
    }
    block.count = i;
    events_ = events_.subspan(i * kEventBytes);
    if (events_.size() < kEventBytes) events_ = {};
    return true;
  }

  Aedat4File file_;
  int id_;
  std::span<const std::byte> events_;  ///< of the packet at hand, not given yet
};

/// A time in microseconds of a message; a damaged one may be anything.
Expected<TimeNs> time_of(const FlatTable& table, unsigned slot, const std::string& path) {
  const auto t_us = table.number<std::int64_t>(slot);
  if (t_us <= kLargestTimeUs && t_us >= -kLargestTimeUs) return t_us * kNsPerUs;
  return Error{path, text("the stamp ", t_us, " us is out of range"), "the file is damaged; copy it again"};
}

Status give_imu(const FlatTable& packet, const std::string& path, const SensorSink& sink) {
  const auto samples = packet.vector(0, 4);
  for (std::size_t i = 0; samples && i < samples->size(); ++i) {
    const auto s = samples->table(i);
    if (!s) continue;
    const auto number = [&](unsigned slot) { return static_cast<double>(s->number<float>(slot)); };
    const auto t = time_of(*s, 0, path);
    if (!t) return t.error();
    ImuSample sample;
    sample.t = *t;
    sample.accel = kStandardGravity * Eigen::Vector3d(number(2), number(3), number(4));
    sample.gyro = kRadians * Eigen::Vector3d(number(5), number(6), number(7));
    sink.imu(sample);
  }
  return {};
}

Status give_triggers(const FlatTable& packet, const std::string& path, const SensorSink& sink) {
  constexpr int kRising = 1, kPulse = 3, kGeneratorRising = 4, kFrameBegin = 6, kExposureBegin = 8;
  const auto triggers = packet.vector(0, 4);
  for (std::size_t i = 0; triggers && i < triggers->size(); ++i) {
    const auto trigger = triggers->table(i);
    if (!trigger) continue;
    const auto t = time_of(*trigger, 0, path);
    if (!t) return t.error();
    const int kind = trigger->number<std::uint8_t>(1);
    const bool on = kind == kRising || kind == kPulse || kind == kGeneratorRising || kind == kFrameBegin ||
                    kind == kExposureBegin;
    sink.trigger({*t, on, kind});
  }
  return {};
}

Status give_frame(const FlatTable& f, const std::string& path, const SensorSink& sink) {
  enum Slot { kTime, kFrameStart, kFrameEnd, kExposureStart, kExposureEnd, kFormat, kSizeX, kSizeY };
  constexpr unsigned kPixels = 10;
  const auto time = time_of(f, kTime, path), begin = time_of(f, kExposureStart, path),
             end = time_of(f, kExposureEnd, path);
  for (const auto* t : {&time, &begin, &end})
    if (!*t) return t->error();
  GreyFrame frame;
  frame.t = *begin > 0 && *end >= *begin ? *begin + (*end - *begin) / 2 : *time;
  const int format = f.number<std::uint8_t>(kFormat);
  frame.channels = format == 0 ? 1 : format == 16 ? 3 : format == 24 ? 4 : 0;
  frame.width = f.number<std::int16_t>(kSizeX);
  frame.height = f.number<std::int16_t>(kSizeY);
  const auto pixels = f.vector(kPixels, 1);
  const auto wanted = static_cast<std::size_t>(frame.channels) *
                      static_cast<std::size_t>(std::max(frame.width, 0)) *
                      static_cast<std::size_t>(std::max(frame.height, 0));
  if (!pixels || wanted == 0 || pixels->size() != wanted)
    return Error{path,
                 text("a frame of ", frame.width, " x ", frame.height, " pixels in format ", format, " has ",
                      pixels ? pixels->size() : 0, " bytes"),
                 "only 8-bit grey and colour frames can be read"};
  const std::string_view bytes = as_text(pixels->bytes());
  frame.pixels.assign(bytes.begin(), bytes.end());
  sink.frame(frame);
  return {};
}

}  // namespace

bool starts_as_aedat4(std::string_view head) { return head.starts_with("#!AER-DAT4"); }

Expected<std::unique_ptr<EventReader>> open_events_aedat4(const std::string& path,
                                                          const EventReadOptions& options) {
  const auto file = Aedat4File::open(path);
  if (!file) return file.error();
  const Aedat4Stream* stream = file->find("EVTS", options.topic);
  if (stream == nullptr) return no_stream(path, options.topic);
  return make_event_reader(path, options, stream->size,
                           [path, number = options.topic] { return Aedat4Source::open(path, number); });
}

Expected<std::vector<StreamInfo>> list_aedat4_streams(const std::string& path) {
  auto file = Aedat4File::open(path);
  if (!file) return file.error();
  std::vector<StreamInfo> infos;
  for (const Aedat4Stream& s : file->streams()) {
    const StreamKind kind = s.type == "EVTS"   ? StreamKind::events
                            : s.type == "IMUS" ? StreamKind::imu
                            : s.type == "FRME" ? StreamKind::frames
                            : s.type == "TRIG" ? StreamKind::triggers
                                               : StreamKind::other;
    infos.push_back({kind, std::to_string(s.id), s.type, 0});
  }
  while (file->next())
    for (StreamInfo& info : infos) info.messages += info.name == std::to_string(file->stream()) ? 1 : 0;
  return infos;
}

Status read_aedat4_sensors(const std::string& path, const std::string& name, const SensorSink& sink) {
  auto file = Aedat4File::open(path);
  if (!file) return file.error();
  const auto id_of = [&](const char* type, bool wanted) {
    const Aedat4Stream* stream = wanted ? file->find(type, name) : nullptr;
    return stream == nullptr ? -1 : stream->id;
  };
  const int imu = id_of("IMUS", sink.imu != nullptr), triggers = id_of("TRIG", sink.trigger != nullptr),
            frames = id_of("FRME", sink.frame != nullptr);
  while (file->next()) {
    const int id = file->stream();
    if (id < 0 || (id != imu && id != triggers && id != frames)) continue;
    const auto packet = file->message(id == imu ? "IMUS" : id == triggers ? "TRIG" : "FRME");
    if (!packet) return packet.error();
    const auto give = id == imu ? give_imu : id == triggers ? give_triggers : give_frame;
    if (auto status = give(*packet, path, sink); !status) return status;
  }
  return {};
}

}  // namespace evpose
