// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/io/files/compression.h"

#include <bzlib.h>
#include <lz4frame.h>
#include <lzf.h>
#include <zstd.h>

#include <algorithm>
#include <climits>
#include <cstdint>
#include <memory>

namespace evpose {
namespace {

constexpr std::size_t kFirstRoom = 64 << 10;
constexpr std::size_t kLongestPiece = 1 << 30;  // bzip2 counts in 32 bits

/// A decoder takes some input and writes some output.
struct Step {
  std::size_t used = 0, written = 0;
  bool finished = false;  ///< a frame ends here
  bool damaged = false;
};

class Lz4 {
 public:
  Lz4() { damaged_ = LZ4F_isError(LZ4F_createDecompressionContext(&context_, LZ4F_VERSION)) != 0; }
  Lz4(const Lz4&) = delete;
  Lz4& operator=(const Lz4&) = delete;
  ~Lz4() { LZ4F_freeDecompressionContext(context_); }

  Step step(std::span<const std::byte> in, std::span<std::byte> out) {
    if (damaged_) return {.damaged = true};
    std::size_t used = in.size(), written = out.size();
    const std::size_t hint = LZ4F_decompress(context_, out.data(), &written, in.data(), &used, nullptr);
    return {used, written, hint == 0, LZ4F_isError(hint) != 0};
  }

 private:
  LZ4F_dctx* context_ = nullptr;
  bool damaged_ = false;
};

class Zstd {
 public:
  Step step(std::span<const std::byte> in, std::span<std::byte> out) {
    ZSTD_inBuffer input{in.data(), in.size(), 0};
    ZSTD_outBuffer output{out.data(), out.size(), 0};
    const std::size_t hint = ZSTD_decompressStream(stream_.get(), &output, &input);
    return {input.pos, output.pos, hint == 0, ZSTD_isError(hint) != 0};
  }

 private:
  struct Free {
    void operator()(ZSTD_DStream* stream) const { ZSTD_freeDStream(stream); }
  };
  std::unique_ptr<ZSTD_DStream, Free> stream_{ZSTD_createDStream()};
};

class Bzip2 {
 public:
  Bzip2() { damaged_ = BZ2_bzDecompressInit(&stream_, 0, 0) != BZ_OK; }
  Bzip2(const Bzip2&) = delete;
  Bzip2& operator=(const Bzip2&) = delete;
  ~Bzip2() { BZ2_bzDecompressEnd(&stream_); }

  Step step(std::span<const std::byte> in, std::span<std::byte> out) {
    if (damaged_) return {.damaged = true};
    if (over_) return {.finished = true};
    const auto available = static_cast<unsigned>(std::min(in.size(), kLongestPiece));
    const auto room = static_cast<unsigned>(std::min(out.size(), kLongestPiece));
    // The library's interface is older than const.
    stream_.next_in = const_cast<char*>(reinterpret_cast<const char*>(in.data()));  // NOLINT
    stream_.avail_in = available;
    stream_.next_out = reinterpret_cast<char*>(out.data());
    stream_.avail_out = room;
    const int result = BZ2_bzDecompress(&stream_);
    over_ = result == BZ_STREAM_END;
    return {available - stream_.avail_in, room - stream_.avail_out, over_, result != BZ_OK && !over_};
  }

 private:
  bz_stream stream_ = {};
  bool damaged_ = false, over_ = false;
};

template <class Decoder>
Expected<std::size_t> run(Decoder decoder, std::span<const std::byte> data, std::size_t largest,
                          const std::string& where, std::vector<std::byte>& room) {
  std::size_t size = 0;
  bool finished = false;
  while (!finished || !data.empty()) {
    if (size == room.size()) {
      // One byte more than allowed is room to notice that there is more.
      const std::size_t wanted = std::max({kFirstRoom, 2 * room.size(), 2 * data.size()});
      room.resize(std::min(wanted, largest + 1));
    }
    const Step step = decoder.step(data, std::span(room).subspan(size));
    if (step.damaged)
      return Error{where, "its compressed data are damaged", "copy the file again from its source"};
    data = data.subspan(step.used);
    size += step.written;
    finished = step.finished;
    if (size > largest)
      return Error{where, text("is compressed from more than ", largest, " bytes"), "is it damaged?"};
    if (step.used != 0 || step.written != 0 || (finished && data.empty())) continue;
    if (finished) break;  // what follows a bzip2 stream is padding
    return Error{where, "its compressed data are cut off", "copy the file again from its source"};
  }
  return size;
}

std::vector<std::byte> compress_lz4(std::span<const std::byte> data) {
  LZ4F_preferences_t preferences = LZ4F_INIT_PREFERENCES;
  preferences.frameInfo.blockSizeID = LZ4F_max4MB;
  preferences.frameInfo.blockMode = LZ4F_blockIndependent;  // ROS 1 knows no other
  preferences.frameInfo.contentChecksumFlag = LZ4F_contentChecksumEnabled;
  std::vector<std::byte> out(LZ4F_compressFrameBound(data.size(), &preferences));
  const std::size_t size = LZ4F_compressFrame(out.data(), out.size(), data.data(), data.size(), &preferences);
  EVPOSE_CHECK(LZ4F_isError(size) == 0);
  out.resize(size);
  return out;
}

std::vector<std::byte> compress_zstd(std::span<const std::byte> data) {
  constexpr int kLevel = 1;  // as fast as disks; higher ones gain little on events
  std::vector<std::byte> out(ZSTD_compressBound(data.size()));
  const std::size_t size = ZSTD_compress(out.data(), out.size(), data.data(), data.size(), kLevel);
  EVPOSE_CHECK(ZSTD_isError(size) == 0);
  out.resize(size);
  return out;
}

}  // namespace

Expected<std::size_t> decompress(Compression method, std::span<const std::byte> data, std::size_t largest,
                                 const std::string& where, std::vector<std::byte>& room) {
  if (method == Compression::lz4) return run(Lz4(), data, largest, where, room);
  if (method == Compression::zstd) return run(Zstd(), data, largest, where, room);
  if (method == Compression::bz2) return run(Bzip2(), data, largest, where, room);
  if (data.size() > largest) return Error{where, text("has more than ", largest, " bytes"), "is it damaged?"};
  if (room.size() < data.size()) room.resize(data.size());
  std::copy(data.begin(), data.end(), room.begin());
  return data.size();
}

bool decompress_lzf(std::span<const std::byte> block, std::span<std::byte> out) {
  if (block.empty()) return out.empty();  // the library reads a byte before it looks how many there are
  if (block.size() > UINT_MAX || out.size() > UINT_MAX) return false;
  const unsigned written = lzf_decompress(block.data(), static_cast<unsigned>(block.size()), out.data(),
                                          static_cast<unsigned>(out.size()));
  return written != 0 && written == out.size();
}

std::vector<std::byte> compress(Compression method, std::span<const std::byte> data) {
  EVPOSE_CHECK(method != Compression::bz2);
  if (method == Compression::lz4) return compress_lz4(data);
  if (method == Compression::zstd) return compress_zstd(data);
  return {data.begin(), data.end()};
}

}  // namespace evpose
