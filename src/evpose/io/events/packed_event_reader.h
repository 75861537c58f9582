// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <functional>
#include <memory>
#include <string>

#include "evpose/io/events/event_packer.h"
#include "evpose/io/events/event_reader.h"

namespace evpose {

/// The reader of every format: a packer, which owns what it fetches from, and how the extent is found.
/// `extent` is called when it is first asked for.
std::unique_ptr<EventReader> make_packed_reader(EventPacker packer, std::function<EventExtent()> extent);

/// Of first and last stamps in the file's own microseconds.
EventExtent make_extent(std::int64_t first_us, std::int64_t last_us, std::int64_t count,
                        const EventReadOptions& options);

/// An error if the options name another unit than the only one, `unit`, that the format's stamps can have.
Status check_time_unit(const std::string& path, const EventReadOptions& options, const std::string& unit);

}  // namespace evpose
