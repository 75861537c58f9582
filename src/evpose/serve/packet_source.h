// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <string>

#include "evpose/camera/camera.h"
#include "evpose/core/error.h"
#include "evpose/serve/stream_queue.h"

namespace evpose {

/// Whether the words are an address of packets: udp:// or tcp://.
bool is_packet_address(const std::string& address);

/// Packets of a camera's driver by way of udp://HOST:PORT (datagrams to us) or tcp://HOST:PORT (one driver at
/// a time connects to us). It never ends by itself; a driver that goes and comes again is named. Errors: no
/// such address, the port is in use.
Expected<std::unique_ptr<Source>> open_packet_source(const std::string& address, ImageSize size);

}  // namespace evpose
