// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/mavlink/link.h"

#include <fcntl.h>
#include <netdb.h>
#include <sys/socket.h>
#include <termios.h>
#include <unistd.h>

#include <cerrno>
#include <charconv>
#include <cstring>
#include <ctime>
#include <optional>

namespace evpose {

TimeNs monotonic_ns() {
  timespec now{};
  ::clock_gettime(CLOCK_MONOTONIC, &now);
  return TimeNs{now.tv_sec} * kNsPerS + now.tv_nsec;
}

namespace mavlink {
namespace {

constexpr const char* kForms = "give udp://HOST:PORT, udpin://HOST:PORT or serial:///dev/ttyX:BAUD";
constexpr std::size_t kLargestTail = 4096;  // of a serial line that takes less than it is given

struct Rate {
  unsigned long baud;
  speed_t speed;
};
constexpr Rate kRates[] = {{9600, B9600},     {19200, B19200},     {38400, B38400},     {57600, B57600},
                           {115200, B115200}, {230400, B230400},   {460800, B460800},   {500000, B500000},
                           {921600, B921600}, {1000000, B1000000}, {1500000, B1500000}, {2000000, B2000000}};

std::optional<speed_t> speed_of(unsigned long baud) {
  for (const Rate& rate : kRates)
    if (rate.baud == baud) return rate.speed;
  return std::nullopt;
}

bool takes_prefix(std::string& text, const std::string& prefix) {
  if (text.compare(0, prefix.size(), prefix) != 0) return false;
  text.erase(0, prefix.size());
  return true;
}

}  // namespace

Expected<std::unique_ptr<Link>> Link::open(const std::string& address) {
  std::unique_ptr<Link> link(new Link);
  std::string rest = address;
  const bool listen = takes_prefix(rest, "udpin://");
  const bool udp = listen || takes_prefix(rest, "udp://");
  const bool serial = !udp && takes_prefix(rest, "serial://");
  const auto colon = rest.rfind(':');
  unsigned long number = 0;
  if (colon != std::string::npos) std::from_chars(rest.data() + colon + 1, rest.data() + rest.size(), number);
  if ((!udp && !serial) || colon == std::string::npos || colon == 0 || number == 0 || (udp && number > 65535))
    return Error{"'" + address + "'", "no address of a link", kForms};
  Status opened;
  if (udp) {
    link->kind_ = listen ? Kind::udp_listener : Kind::udp;
    opened = link->open_udp(rest.substr(0, colon), rest.substr(colon + 1), listen);
  } else {
    link->kind_ = Kind::serial;
    link->device_ = rest.substr(0, colon);
    link->baud_ = number;
    if (!speed_of(number))
      return Error{address, text(number, " baud is no rate of a serial line"),
                   "such as 57600, 115200, 921600"};
    opened = link->open_serial();
  }
  if (!opened) return Error{address, opened.error().what, opened.error().fix};
  return link;
}

Link::~Link() {
  if (descriptor_ >= 0) ::close(descriptor_);
}

Status Link::open_udp(const std::string& host, const std::string& port, bool listen) {
  addrinfo hints{}, *found = nullptr;
  hints.ai_family = AF_UNSPEC;
  hints.ai_socktype = SOCK_DGRAM;
  if (listen) hints.ai_flags = AI_PASSIVE;
  if (const int fault = ::getaddrinfo(host.c_str(), port.c_str(), &hints, &found); fault != 0)
    return Error{"", "host not found: " + std::string(::gai_strerror(fault)), "check its name"};
  descriptor_ = ::socket(found->ai_family, SOCK_DGRAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
  const int done = descriptor_ < 0 ? -1
                   : listen        ? ::bind(descriptor_, found->ai_addr, found->ai_addrlen)
                                   : ::connect(descriptor_, found->ai_addr, found->ai_addrlen);
  const int fault = errno;
  ::freeaddrinfo(found);
  if (done == 0) return {};
  if (fault == EADDRINUSE)
    return Error{"", "the port is in use", "end the program that has it, or give another port"};
  return Error{"", std::strerror(fault), "check the address"};
}

Status Link::open_serial() {
  const int opened = ::open(device_.c_str(), O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC);
  if (opened < 0)
    return Error{"", std::strerror(errno), "plug it in, or check the name and the rights (group dialout)"};
  termios settings{};
  if (::tcgetattr(opened, &settings) != 0) {
    ::close(opened);
    return Error{"", "no serial line", "give a tty device"};
  }
  ::cfmakeraw(&settings);
  settings.c_cflag |= CLOCAL | CREAD;
  ::cfsetspeed(&settings, *speed_of(baud_));
  ::tcsetattr(opened, TCSANOW, &settings);
  descriptor_ = opened;
  return {};
}

void Link::lose_device(const char* why) {
  ::close(descriptor_);
  descriptor_ = -1;
  tail_.clear();
  ++counts_.lost_devices;
  notice_ = "serial line " + device_ + " is gone (" + why + "); trying again each second";
  next_retry_ = monotonic_ns() + kNsPerS;
}

void Link::retry_device() {
  if (kind_ != Kind::serial || monotonic_ns() < next_retry_) return;
  next_retry_ = monotonic_ns() + kNsPerS;
  if (open_serial()) notice_ = "serial line " + device_ + " is back";
}

bool Link::send(Bytes frame) {
  if (descriptor_ < 0) retry_device();
  const auto lose = [&] {
    ++counts_.lost;
    return false;
  };
  if (descriptor_ < 0) return lose();
  if (kind_ != Kind::serial) {
    if (kind_ == Kind::udp_listener && !has_peer_) return lose();
    const auto* peer = kind_ == Kind::udp ? nullptr : reinterpret_cast<const sockaddr*>(peer_.data());
    const ssize_t sent = ::sendto(descriptor_, frame.data(), frame.size(), MSG_NOSIGNAL, peer,
                                  peer ? static_cast<socklen_t>(peer_.size()) : 0);
    if (sent != static_cast<ssize_t>(frame.size())) return lose();  // nobody listens yet, or no room
    ++counts_.sent;
    return true;
  }
  // A line that is behind keeps the rest of what it has begun; whole frames are lost, never halves.
  if (tail_.size() + frame.size() > kLargestTail) return lose();
  tail_.insert(tail_.end(), frame.begin(), frame.end());
  const ssize_t sent = ::write(descriptor_, tail_.data(), tail_.size());
  if (sent < 0 && errno != EAGAIN && errno != EINTR) {
    lose_device(std::strerror(errno));
    return lose();
  }
  if (sent > 0) tail_.erase(tail_.begin(), tail_.begin() + sent);
  ++counts_.sent;
  return true;
}

Bytes Link::receive() {
  if (descriptor_ < 0) retry_device();
  if (descriptor_ < 0) return {};
  if (kind_ == Kind::serial) {
    const ssize_t got = ::read(descriptor_, buffer_.data(), buffer_.size());
    if (got < 0 && errno != EAGAIN && errno != EINTR) lose_device(std::strerror(errno));
    return {buffer_.data(), got > 0 ? static_cast<std::size_t>(got) : 0};
  }
  sockaddr_storage from{};
  socklen_t size = sizeof from;
  const ssize_t got =
      ::recvfrom(descriptor_, buffer_.data(), buffer_.size(), 0, reinterpret_cast<sockaddr*>(&from), &size);
  if (got <= 0) return {};  // also what a closed port at the other end reports
  const auto* bytes = reinterpret_cast<const std::uint8_t*>(&from);
  peer_.assign(bytes, bytes + size);
  has_peer_ = true;
  return {buffer_.data(), static_cast<std::size_t>(got)};
}

std::string Link::take_notice() { return std::exchange(notice_, {}); }

}  // namespace mavlink
}  // namespace evpose
