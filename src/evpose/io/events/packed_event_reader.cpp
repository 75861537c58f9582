// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/io/events/packed_event_reader.h"

#include <optional>
#include <utility>

namespace evpose {
namespace {

class PackedEventReader : public EventReader {
 public:
  PackedEventReader(EventPacker packer, std::function<EventExtent()> extent)
      : packer_(std::move(packer)), find_extent_(std::move(extent)) {}

  Expected<bool> next(EventPacket& packet) override { return packer_.next(packet); }
  ImageSize size() const override { return packer_.size(); }
  EventExtent extent() const override {
    if (!extent_) extent_ = find_extent_();
    return *extent_;
  }

 private:
  EventPacker packer_;
  std::function<EventExtent()> find_extent_;
  mutable std::optional<EventExtent> extent_;
};

}  // namespace

std::unique_ptr<EventReader> make_packed_reader(EventPacker packer, std::function<EventExtent()> extent) {
  return std::make_unique<PackedEventReader>(std::move(packer), std::move(extent));
}

EventExtent make_extent(std::int64_t first_us, std::int64_t last_us, std::int64_t count,
                        const EventReadOptions& options) {
  return {first_us * kNsPerUs + options.offset_ns, last_us * kNsPerUs + options.offset_ns, count};
}

Status check_time_unit(const std::string& path, const EventReadOptions& options, const std::string& unit) {
  if (options.time_unit.empty() || options.time_unit == unit) return {};
  return Error{path, "events.time_unit '" + options.time_unit + "': this format's stamps are in " + unit,
               "leave events.time_unit out"};
}

}  // namespace evpose
