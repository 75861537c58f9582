// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/serve/packet_source.h"

#include <netdb.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cerrno>
#include <charconv>
#include <cstring>
#include <vector>

#include "evpose/serve/packets.h"

namespace evpose {
namespace {

constexpr int kReceiveBuffer = 8 << 20;  // bytes asked of the system: 20 ms of 40 Mev/s
constexpr int kPoll_ms = 50;             // so that a closed queue is soon noticed

class Descriptor {
 public:
  explicit Descriptor(int value = -1) : value_(value) {}
  ~Descriptor() { reset(); }
  Descriptor(const Descriptor&) = delete;
  Descriptor& operator=(const Descriptor&) = delete;
  void reset(int value = -1) {
    if (value_ >= 0) ::close(value_);
    value_ = value;
  }
  int get() const { return value_; }

 private:
  int value_;
};

class PacketSource : public Source {
 public:
  PacketSource(int descriptor, bool tcp, ImageSize size)
      : listener_(descriptor), tcp_(tcp), size_(size), decoder_(size) {}

  void run(StreamQueue& queue) override {
    std::vector<std::uint8_t> buffer(1 << 18);
    while (!queue.closed()) {
      pollfd waiting{tcp_ && client_.get() >= 0 ? client_.get() : listener_.get(), POLLIN, 0};
      if (::poll(&waiting, 1, kPoll_ms) <= 0) continue;
      if (tcp_ && client_.get() < 0) {
        accept_driver(queue);
        continue;
      }
      const ssize_t got = ::recv(waiting.fd, buffer.data(), buffer.size(), 0);
      if (got < 0 && (errno == EAGAIN || errno == EINTR)) continue;
      if (got <= 0 && tcp_) {
        client_.reset();
        say(queue,
            text("the driver has gone after ", decoder_.counts().packets, " packets; waiting for another"));
      }
      if (got <= 0) continue;
      items_.clear();
      const std::span<const std::uint8_t> bytes(buffer.data(), static_cast<std::size_t>(got));
      if (tcp_)
        decoder_.stream(bytes, items_);
      else
        decoder_.datagram(bytes, items_);
      for (StreamItem& item : items_)
        if (!queue.push(std::move(item))) return;
      tell_faults(queue);
    }
  }

 private:
  void accept_driver(StreamQueue& queue) {
    client_.reset(::accept4(listener_.get(), nullptr, nullptr, SOCK_CLOEXEC));
    if (client_.get() < 0) return;
    decoder_ = PacketDecoder(size_);
    told_ = {};
    say(queue, "a driver has connected");
  }

  static void say(StreamQueue& queue, std::string words) {
    StreamItem item;
    item.kind = StreamItem::Kind::notice;
    item.words = std::move(words);
    queue.push(std::move(item));
  }

  /// Once for each kind of fault, and again each time its count has grown tenfold.
  void tell_faults(StreamQueue& queue) {
    const auto tell = [&](std::uint64_t now, std::uint64_t& told, const char* what) {
      if (now < 10 * told || now == 0) return;
      told = now;
      say(queue, text(now, " ", what));
    };
    const auto& c = decoder_.counts();
    tell(c.missed, told_.missed, "packets of the driver are missing by their numbers");
    tell(c.bad_packets, told_.bad_packets,
         "pieces that are no packets were skipped (docs/use/live.md has the format)");
    tell(c.bad_events, told_.bad_events, "events out of order or outside of the image were left out");
    tell(c.bad_samples, told_.bad_samples, "IMU samples that are not finite were left out");
  }

  Descriptor listener_, client_;
  bool tcp_;
  ImageSize size_;
  PacketDecoder decoder_;
  PacketDecoder::Counts told_;
  std::vector<StreamItem> items_;
};

}  // namespace

bool is_packet_address(const std::string& address) {
  return address.rfind("udp://", 0) == 0 || address.rfind("tcp://", 0) == 0;
}

Expected<std::unique_ptr<Source>> open_packet_source(const std::string& address, ImageSize size) {
  const bool tcp = address.rfind("tcp://", 0) == 0;
  const std::string rest = address.substr(6);
  const auto colon = rest.rfind(':');
  int port = 0;
  if (colon != std::string::npos) std::from_chars(rest.data() + colon + 1, rest.data() + rest.size(), port);
  if (colon == std::string::npos || colon == 0 || port < 1 || port > 65535)
    return Error{"'" + address + "'", "no address of a source", "give udp://HOST:PORT or tcp://HOST:PORT"};
  addrinfo hints{}, *found = nullptr;
  hints.ai_socktype = tcp ? SOCK_STREAM : SOCK_DGRAM;
  hints.ai_flags = AI_PASSIVE;
  if (const int fault =
          ::getaddrinfo(rest.substr(0, colon).c_str(), rest.substr(colon + 1).c_str(), &hints, &found);
      fault != 0)
    return Error{address, "host not found: " + std::string(::gai_strerror(fault)),
                 "give 127.0.0.1 for this machine"};
  const int made = ::socket(found->ai_family, found->ai_socktype | SOCK_CLOEXEC, 0);
  const int yes = 1;
  if (tcp) ::setsockopt(made, SOL_SOCKET, SO_REUSEADDR, &yes, sizeof yes);
  ::setsockopt(made, SOL_SOCKET, SO_RCVBUF, &kReceiveBuffer, sizeof kReceiveBuffer);
  const bool bound = ::bind(made, found->ai_addr, found->ai_addrlen) == 0 && (!tcp || ::listen(made, 1) == 0);
  const int fault = errno;
  ::freeaddrinfo(found);
  if (bound) return std::unique_ptr<Source>(new PacketSource(made, tcp, size));
  ::close(made);
  if (fault == EADDRINUSE)
    return Error{address, "the port is in use", "end the program that has it, or give another port"};
  return Error{address, std::strerror(fault), "check the address"};
}

}  // namespace evpose
