// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <array>

#include "evpose/io/bags/bag_messages.h"
#include "evpose/io/bags/bag_streams.h"
#include "evpose/io/bags/event_messages.h"

namespace evpose {
namespace {

/// Hands over what the messages hold; keeps what goes on from one to the next.
class Dispatch {
 public:
  explicit Dispatch(const SensorSink& sink) : sink_(sink) {}

  /// Whether there is somebody to take messages of the topic.
  bool wants(const BagTopic& topic) const {
    switch (kind_of_topic(topic)) {
      case StreamKind::imu:
        return static_cast<bool>(sink_.imu);
      case StreamKind::frames:
        return static_cast<bool>(sink_.frame);
      case StreamKind::poses:
        return static_cast<bool>(sink_.pose);
      case StreamKind::events:
        return sink_.trigger && is_event_packet(topic.type);
      default:
        return false;
    }
  }

  Status take(const BagTopic& topic, const BagMessage& message, const std::string& where) {
    switch (kind_of_topic(topic)) {
      case StreamKind::imu:
        return hand(parse_imu(topic, message, where), sink_.imu);
      case StreamKind::frames:
        return hand(parse_image(topic, message, where), sink_.frame);
      case StreamKind::poses:
        return hand(parse_pose(topic, message, where), sink_.pose);
      default:
        return take_triggers(topic, message, where);
    }
  }

 private:
  template <class Value>
  Status hand(const Expected<Value>& value, const std::function<void(const Value&)>& to) {
    if (!value) return value.error();
    to(*value);
    return {};
  }

  Status take_triggers(const BagTopic& topic, const BagMessage& message, const std::string& where) {
    const auto parsed = parse_event_message(topic, message, where);
    if (!parsed) return parsed.error();
    decoder_.begin(*parsed, where);
    for (bool all = false; !all;) {
      block_.start();
      const auto decoded = decoder_.decode(block_, &triggers_);
      if (!decoded) return decoded.error();
      all = *decoded;
    }
    for (const Trigger& trigger : triggers_) sink_.trigger(trigger);
    triggers_.clear();
    return {};
  }

  const SensorSink& sink_;
  EventMessageDecoder decoder_;
  EventBlock block_;
  std::vector<Trigger> triggers_;
};

/// The named topic, or the first of each kind that somebody wants.
std::vector<std::size_t> choose(const BagReader& bag, const std::string& name, const Dispatch& dispatch) {
  std::vector<std::size_t> out;
  std::vector<StreamKind> kinds;
  for (std::size_t i = 0; i < bag.topics().size(); ++i) {
    const BagTopic& topic = bag.topics()[i];
    const StreamKind kind = kind_of_topic(topic);
    const bool first = topic.messages != 0 && std::find(kinds.begin(), kinds.end(), kind) == kinds.end();
    if (!dispatch.wants(topic) || !(name.empty() ? first : topic.name == name)) continue;
    kinds.push_back(kind);
    out.push_back(i);
  }
  return out;
}

}  // namespace

Expected<std::vector<StreamInfo>> list_bag_streams(const std::string& path) {
  auto bag = open_bag(path);
  if (!bag) return bag.error();
  if (auto status = (*bag)->count_messages(); !status) return status.error();
  std::vector<StreamInfo> out;
  for (const BagTopic& topic : (*bag)->topics())
    out.push_back({kind_of_topic(topic), topic.name, topic.type, topic.messages});
  return out;
}

Status read_bag_sensors(const std::string& path, const std::string& name, const SensorSink& sink) {
  auto opened = open_bag(path);
  if (!opened) return opened.error();
  BagReader& bag = **opened;
  const auto& topics = bag.topics();
  if (!name.empty() &&
      std::none_of(topics.begin(), topics.end(), [&](const BagTopic& t) { return t.name == name; }))
    return Error{path, "has no topic '" + name + "'", "`evpose info` lists its topics"};
  Dispatch dispatch(sink);
  const auto chosen = choose(bag, name, dispatch);
  for (const std::size_t topic : chosen)
    if (auto status = check_definition(topics[topic], path); !status) return status;
  if (chosen.empty()) return {};
  if (auto status = bag.select(chosen); !status) return status;
  std::vector<std::int64_t> numbers(topics.size(), 0);
  BagMessage message;
  while (true) {
    const auto more = bag.next(message);
    if (!more) return more.error();
    if (!*more) return {};
    const std::string where =
        text(path, ", ", topics[message.topic].name, ", message ", numbers[message.topic]++, " (from 0)");
    if (auto status = dispatch.take(topics[message.topic], message, where); !status) return status;
  }
}

}  // namespace evpose
