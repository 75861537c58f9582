// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>

#include "evpose/core/log.h"
#include "evpose/io/bags/bag_messages.h"
#include "evpose/io/bags/bag_streams.h"
#include "evpose/io/bags/event_messages.h"
#include "evpose/io/events/packed_event_reader.h"

namespace evpose {
namespace {

constexpr std::int64_t kEvt3WrapUs = std::int64_t{1} << 24;

/// Events of one topic, block by block.
class Source {
 public:
  Source(std::unique_ptr<BagReader> bag, std::size_t topic, std::string path)
      : bag_(std::move(bag)), topic_(topic), path_(std::move(path)) {}

  /// Some events; false at the end.
  Expected<bool> fetch(EventBlock& block);
  /// Forgets all and begins with the file's first message, or near the last.
  Status restart(bool near_the_last);

  const EventMessage& message() const { return message_; }
  std::size_t topic() const { return topic_; }

 private:
  std::unique_ptr<BagReader> bag_;
  std::size_t topic_;
  std::string path_;
  EventMessageDecoder decoder_;
  EventMessage message_;
  std::int64_t number_ = 0;  ///< of messages so far
  bool used_ = true;         ///< nothing is left of the message
};

Status Source::restart(bool near_the_last) {
  decoder_ = {};
  used_ = true;
  number_ = 0;
  if (auto status = bag_->select({topic_}); !status) return status;
  return near_the_last ? bag_->go_to_last(topic_) : bag_->rewind();
}

Expected<bool> Source::fetch(EventBlock& block) {
  block.start();
  while (block.count < kBlockEvents) {
    if (used_) {
      BagMessage message;
      const auto more = bag_->next(message);
      if (!more) return more.error();
      if (!*more) return block.count > 0;
      std::string where =
          text(path_, ", ", bag_->topics()[topic_].name, ", message ", number_++, " (from 0)");
      const auto parsed = parse_event_message(bag_->topics()[topic_], message, where);
      if (!parsed) return parsed.error();
      message_ = *parsed;
      decoder_.begin(message_, std::move(where));
    }
    const auto all = decoder_.decode(block);
    if (!all) return all.error();
    used_ = *all;
    if (!used_) break;
  }
  return true;
}

struct Ends {
  std::int64_t first_us = 0, last_us = 0;
  ImageSize size;
};

/// A stamp of the sensor's short clock, counted from a message near the end, moved by whole wraps to where
/// the recorder's clock has it.
std::int64_t unwrapped(std::int64_t t_us, std::int64_t expected_us) {
  const double wraps = static_cast<double>(expected_us - t_us) / static_cast<double>(kEvt3WrapUs);
  return t_us + std::llround(wraps) * kEvt3WrapUs;
}

/// Leaves the source at its beginning.
Expected<Ends> find_ends(Source& source, const std::string& path) {
  Ends out;
  EventBlock block;
  if (auto status = source.restart(false); !status) return status.error();
  do {
    const auto more = source.fetch(block);
    if (!more) return more.error();
    if (!*more) return Error{path, "holds no events", "record again, or choose another topic"};
  } while (block.count == 0);
  out.first_us = out.last_us = block.time_us(0);
  out.size = source.message().size;
  const TimeNs first_stamp = source.message().stamp;

  if (auto status = source.restart(true); !status) return status.error();
  std::int64_t last = INT64_MIN;
  while (true) {
    const auto more = source.fetch(block);
    if (!more) return more.error();
    if (!*more) break;
    if (block.count > 0) last = block.time_us(block.count - 1);
  }
  const std::int64_t passed_us = (source.message().stamp - first_stamp) / kNsPerUs;
  if (last == INT64_MIN)
    last = out.first_us + passed_us;
  else if (source.message().encoding == EventMessage::Encoding::evt3)
    last = unwrapped(last, out.first_us + passed_us);
  out.first_us = std::clamp(out.first_us, -kLargestTimeUs, kLargestTimeUs);
  out.last_us = std::clamp(last, out.first_us, kLargestTimeUs);
  if (source.message().encoding == EventMessage::Encoding::evt3)
    log_detail(text(path, ": event stamps are the sensor's own; the recorder's clock was ",
                    to_seconds(first_stamp - out.first_us * kNsPerUs), " s ahead (time.offset_events_s)"));
  if (auto status = source.restart(false); !status) return status.error();
  return out;
}

Expected<std::size_t> choose_topic(const BagReader& bag, const std::string& path, const std::string& name) {
  std::vector<std::size_t> found;
  std::string names;
  for (std::size_t i = 0; i < bag.topics().size(); ++i) {
    const BagTopic& topic = bag.topics()[i];
    if (kind_of_topic(topic) != StreamKind::events) continue;
    names += (names.empty() ? "" : ", ") + topic.name;
    if (name.empty() ? topic.messages != 0 : topic.name == name) found.push_back(i);
  }
  if (names.empty())
    return Error{path, "has no topic of events",
                 "needed is one of type dvs_msgs/EventArray or event_camera_msgs/EventPacket"};
  if (found.empty() && name.empty()) return Error{path, "holds no events", "record again"};
  if (found.empty())
    return Error{path, "has no events on topic '" + name + "'", "set events.topic to one of: " + names};
  if (found.size() > 1 && name.empty())
    log_detail(path + ": events on " + names + "; those of " + bag.topics()[found.front()].name +
               " are read");
  return found.front();
}

}  // namespace

Expected<std::unique_ptr<EventReader>> open_events_bag(const std::string& path,
                                                       const EventReadOptions& options) {
  if (auto status = check_time_unit(path, options, "us"); !status) return status.error();
  auto bag = open_bag(path);
  if (!bag) return bag.error();
  const auto topic = choose_topic(**bag, path, options.topic);
  if (!topic) return topic.error();
  if (auto status = check_definition((*bag)->topics()[*topic], path); !status) return status.error();
  auto source = std::make_shared<Source>(*std::move(bag), *topic, path);
  const auto ends = find_ends(*source, path);
  if (!ends) return ends.error();
  auto packer = EventPacker::make(
      path, options, options.size == ImageSize{} ? ends->size : options.size,
      EventPacker::FetchBlock([source](EventBlock& block) { return source->fetch(block); }));
  if (!packer) return packer.error();
  const auto extent = make_extent(ends->first_us, ends->last_us, -1, options);
  return make_packed_reader(*std::move(packer), [extent] { return extent; });
}

}  // namespace evpose
