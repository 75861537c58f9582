// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include "evpose/camera/camera.h"
#include "evpose/io/events/flat_buffer.h"
#include "evpose/io/files/byte_stream.h"

namespace evpose {

/// One stream that the header of an AEDAT4 file describes.
struct Aedat4Stream {
  int id = 0;
  std::string type;  ///< EVTS, FRME, IMUS, TRIG or another
  ImageSize size;
};

/// An AEDAT4 file, packet by packet.
class Aedat4File {
 public:
  static Expected<Aedat4File> open(const std::string& path);

  const std::vector<Aedat4Stream>& streams() const { return streams_; }
  /// The stream of that type and number (as text); number "": the first. Null: there is none.
  const Aedat4Stream* find(const std::string& type, const std::string& number) const;

  /// Goes to the next packet; false at the end of the packets, also where the last is cut off.
  bool next();
  int stream() const { return stream_; }  ///< of the packet
  /// The packet's message. Errors: damaged.
  Expected<FlatTable> message(const std::string& type);
  /// One warning if the file ended within a packet.
  void warn_if_cut() const;
  const std::string& path() const { return bytes_.path(); }

 private:
  explicit Aedat4File(ByteStream bytes) : bytes_(std::move(bytes)) {}
  Status read_header();

  ByteStream bytes_;
  int compression_ = 0;
  std::int64_t end_ = 0;  ///< of the packets
  std::vector<Aedat4Stream> streams_;
  int stream_ = -1;
  std::size_t payload_ = 0;  ///< bytes of the packet, not yet skipped
  std::int64_t packets_ = 0;
  bool cut_ = false;
  std::vector<std::byte> unpacked_;
};

}  // namespace evpose
