// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "evpose/core/error.h"
#include "evpose/core/time.h"
#include "evpose/mavlink/codec.h"

namespace evpose {

/// Nanoseconds on the machine's monotone clock.
TimeNs monotonic_ns();

namespace mavlink {

/// Bytes to and from an autopilot, never waiting.
class Link {
 public:
  /// udp://HOST:PORT sends there; udpin://HOST:PORT waits for datagrams there and answers the last sender;
  /// serial:///dev/ttyX:BAUD. Errors: none of these; no such host or device; the port is in use.
  static Expected<std::unique_ptr<Link>> open(const std::string& address);
  ~Link();
  Link(const Link&) = delete;
  Link& operator=(const Link&) = delete;

  /// One frame. False: it could not be sent, and is lost and counted.
  bool send(Bytes frame);
  /// What has arrived, at most 64 KiB; empty: nothing. A serial device that went away is tried again once a
  /// second.
  Bytes receive();
  /// A file descriptor that poll() can wait for; -1 while a device is away.
  int descriptor() const { return descriptor_; }

  struct Counts {
    std::uint64_t sent = 0, lost = 0, lost_devices = 0;
  };
  const Counts& counts() const { return counts_; }
  /// A change worth a line, such as a device that went away or came back; empty: none since the last call.
  std::string take_notice();

 private:
  enum class Kind { udp, udp_listener, serial };
  Link() = default;
  Status open_udp(const std::string& host, const std::string& port, bool listen);
  Status open_serial();
  void lose_device(const char* why);
  void retry_device();

  Kind kind_ = Kind::udp;
  std::string device_;
  unsigned long baud_ = 0;
  int descriptor_ = -1;
  bool has_peer_ = false;  ///< of a listener
  std::vector<std::uint8_t> peer_, buffer_ = std::vector<std::uint8_t>(65536), tail_;
  TimeNs next_retry_ = 0;
  std::string notice_;
  Counts counts_;
};

}  // namespace mavlink
}  // namespace evpose
