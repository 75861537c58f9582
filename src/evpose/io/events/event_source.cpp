// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/io/events/event_source.h"

#include <optional>
#include <utility>

#include "evpose/io/events/event_packer.h"

namespace evpose {
namespace {

/// A source whose first events are already there: a file without any is told when it is opened.
class Feed {
 public:
  static Expected<std::unique_ptr<Feed>> make(const std::string& path, const OpenEventSource& open) {
    auto source = open();
    if (!source) return source.error();
    auto feed = std::unique_ptr<Feed>(new Feed(*std::move(source)));
    while (feed->first_.count == 0) {
      const auto more = feed->source_->fetch(feed->first_);
      if (!more) return more.error();
      if (!*more) return Error{path, "holds no events", "record again, or check that the file is complete"};
    }
    return feed;
  }

  Expected<bool> fetch(EventBlock& block) {
    if (first_.count > 0) {
      std::swap(block, first_);
      first_ = {};
      return true;
    }
    auto more = source_->fetch(block);
    if (more && !*more) source_->finish();
    return more;
  }

  std::int64_t first_us() const { return first_.time_us(0); }

 private:
  explicit Feed(std::unique_ptr<EventSource> source) : source_(std::move(source)) {}

  std::unique_ptr<EventSource> source_;
  EventBlock first_;
};

/// First and last stamp and the number of events of the part that can be read.
EventExtent measure(const OpenEventSource& open, const EventReadOptions& options, std::int64_t first_us) {
  std::int64_t last_us = first_us, count = 0;
  EventBlock block;
  const auto source = open();
  while (source) {
    const auto more = (*source)->fetch(block);
    if (!more || !*more) break;
    if (block.count == 0) continue;
    count += static_cast<std::int64_t>(block.count);
    const std::int64_t t_us = block.time_us(block.count - 1);
    if (t_us > last_us && t_us <= kLargestTimeUs) last_us = t_us;
  }
  return {first_us * kNsPerUs + options.offset_ns, last_us * kNsPerUs + options.offset_ns, count};
}

class SourceReader : public EventReader {
 public:
  SourceReader(std::unique_ptr<Feed> feed, EventPacker packer, std::function<EventExtent()> extent)
      : feed_(std::move(feed)), packer_(std::move(packer)), measure_(std::move(extent)) {}

  Expected<bool> next(EventPacket& packet) override { return packer_.next(packet); }
  ImageSize size() const override { return packer_.size(); }
  EventExtent extent() const override {
    if (!extent_) extent_ = measure_();
    return *extent_;
  }

 private:
  std::unique_ptr<Feed> feed_;
  EventPacker packer_;
  std::function<EventExtent()> measure_;
  mutable std::optional<EventExtent> extent_;
};

}  // namespace

Expected<std::unique_ptr<EventReader>> make_event_reader(const std::string& path,
                                                         const EventReadOptions& options, ImageSize size,
                                                         OpenEventSource open) {
  if (!options.time_unit.empty() && options.time_unit != "us")
    return Error{path, "events.time_unit '" + options.time_unit + "': this format's stamps are microseconds",
                 "leave events.time_unit out"};
  auto feed = Feed::make(path, open);
  if (!feed) return feed.error();
  const std::int64_t first_us = (*feed)->first_us();
  if (first_us > kLargestTimeUs || first_us < -kLargestTimeUs)
    return Error{path, text("the first stamp, ", first_us, " us, is out of range"),
                 "the file is damaged; copy it again"};
  if (options.size != ImageSize{}) size = options.size;
  auto packer = EventPacker::make(path, options, size,
                                  [f = feed->get()](EventBlock& block) { return f->fetch(block); });
  if (!packer) return packer.error();
  auto extent = [open = std::move(open), options, first_us] { return measure(open, options, first_us); };
  return std::unique_ptr<EventReader>(
      std::make_unique<SourceReader>(*std::move(feed), *std::move(packer), std::move(extent)));
}

}  // namespace evpose
