// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/io/events/event_source.h"

#include <utility>

#include "evpose/io/events/packed_event_reader.h"

namespace evpose {
namespace {

/// A source whose first events are already there: a file without any is told when it is opened.
class Feed {
 public:
  static Expected<std::shared_ptr<Feed>> make(const std::string& path, const OpenEventSource& open) {
    auto source = open();
    if (!source) return source.error();
    auto feed = std::shared_ptr<Feed>(new Feed(*std::move(source)));
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
  return make_extent(first_us, last_us, count, options);
}

}  // namespace

Expected<std::unique_ptr<EventReader>> make_event_reader(const std::string& path,
                                                         const EventReadOptions& options, ImageSize size,
                                                         OpenEventSource open) {
  if (auto status = check_time_unit(path, options, "us"); !status) return status.error();
  auto feed = Feed::make(path, open);
  if (!feed) return feed.error();
  const std::int64_t first_us = (*feed)->first_us();
  if (first_us > kLargestTimeUs || first_us < -kLargestTimeUs)
    return Error{path, text("the first stamp, ", first_us, " us, is out of range"),
                 "the file is damaged; copy it again"};
  if (options.size != ImageSize{}) size = options.size;
  auto packer =
      EventPacker::make(path, options, size, [f = *feed](EventBlock& block) { return f->fetch(block); });
  if (!packer) return packer.error();
  return make_packed_reader(*std::move(packer), [open = std::move(open), options, first_us] {
    return measure(open, options, first_us);
  });
}

}  // namespace evpose
