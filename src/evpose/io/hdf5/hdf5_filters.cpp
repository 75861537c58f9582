// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/io/hdf5/hdf5_filters.h"

#include <blosc.h>
#include <hdf5.h>
#include <lz4.h>

#include <algorithm>
#include <cstring>
#include <mutex>
#include <span>
#include <vector>

#include "evpose/io/files/compression.h"
#include "evpose/io/hdf5/ecf.h"

namespace evpose {
namespace {

constexpr H5Z_filter_t kLzf = 32000, kBlosc = 32001, kLz4 = 32004, kZstd = 32015, kEcf = 0x8ECF;
/// Chunks larger than this are no one's data.
constexpr std::size_t kLargestChunk = 1u << 30;

thread_local std::size_t chunk_bytes = 0;
/// Room for a checksum that was put behind the chunk before it was compressed.
constexpr std::size_t kSlack = 64;

std::size_t largest() { return chunk_bytes > 0 ? chunk_bytes + kSlack : kLargestChunk; }

using Bytes = std::span<const std::byte>;
using Room = std::vector<std::byte>;
/// Undoes a compression; false when the data are damaged.
using Undo = bool (*)(Bytes in, std::span<const unsigned> parameters, Room& out);

bool undo_blosc(Bytes in, std::span<const unsigned>, Room& out) {
  std::size_t size = 0;
  if (in.size() < BLOSC_MIN_HEADER_LENGTH || blosc_cbuffer_validate(in.data(), in.size(), &size) < 0)
    return false;
  if (size > largest()) return false;
  out.resize(size);
  return size == 0 || blosc_decompress_ctx(in.data(), out.data(), size, 1) == static_cast<int>(size);
}

bool undo_zstd(Bytes in, std::span<const unsigned>, Room& out) {
  const auto size = decompress(Compression::zstd, in, largest(), "", out);
  if (size) out.resize(*size);
  return size.ok();
}

template <class T>
T big_endian(Bytes in) {
  T value = 0;
  for (std::size_t i = 0; i < sizeof(T); ++i) value = static_cast<T>(value << 8 | std::to_integer<T>(in[i]));
  return value;
}

/// Total and block size, then blocks: their length and LZ4 data, or plain bytes where these are not longer.
bool undo_lz4(Bytes in, std::span<const unsigned>, Room& out) {
  if (in.size() < 12) return false;
  const auto total = big_endian<std::uint64_t>(in);
  const std::uint64_t block = std::min<std::uint64_t>(big_endian<std::uint32_t>(in.subspan(8)), total);
  // LZ4 makes at most 255 bytes of one.
  if (total > largest() || total > 255 * in.size() || (total > 0 && block == 0)) return false;
  out.resize(total);
  in = in.subspan(12);
  for (std::size_t done = 0; done < total;) {
    const std::size_t wanted = std::min<std::size_t>(block, total - done);
    if (in.size() < 4) return false;
    const std::size_t stored = big_endian<std::uint32_t>(in);
    in = in.subspan(4);
    if (stored > in.size()) return false;
    if (stored == wanted) {
      std::memcpy(out.data() + done, in.data(), stored);
    } else if (LZ4_decompress_safe(reinterpret_cast<const char*>(in.data()),
                                   reinterpret_cast<char*>(out.data() + done), static_cast<int>(stored),
                                   static_cast<int>(wanted)) != static_cast<int>(wanted)) {
      return false;
    }
    in = in.subspan(stored);
    done += wanted;
  }
  return true;
}

/// Its third parameter is the size of a chunk.
bool undo_lzf(Bytes in, std::span<const unsigned> parameters, Room& out) {
  if (parameters.size() < 3 || parameters[2] > largest()) return false;
  out.resize(parameters[2]);
  return decompress_lzf(in, out);
}

bool undo_ecf(Bytes in, std::span<const unsigned>, Room& out) {
  std::vector<EcfEvent> events;
  if (!decode_ecf(in, events)) return false;
  // The last chunk of a file may hold fewer events than the others.
  out.assign(std::max(events.size() * sizeof(EcfEvent), chunk_bytes), std::byte{0});
  if (!events.empty()) std::memcpy(out.data(), events.data(), events.size() * sizeof(EcfEvent));
  return true;
}

/// What HDF5 calls: the result is the size of the new buffer, 0 when it failed.
template <Undo kUndo>
std::size_t run(unsigned flags, std::size_t parameter_count, const unsigned parameters[], std::size_t size,
                std::size_t* buffer_size, void** buffer) {
  if ((flags & H5Z_FLAG_REVERSE) == 0) return 0;
  Room out;
  const Bytes in(static_cast<const std::byte*>(*buffer), size);
  if (!kUndo(in, {parameters, parameter_count}, out) || out.size() < chunk_bytes || out.empty()) return 0;
  void* fresh = H5allocate_memory(out.size(), false);
  if (fresh == nullptr) return 0;
  std::memcpy(fresh, out.data(), out.size());
  H5free_memory(*buffer);
  *buffer = fresh;
  *buffer_size = out.size();
  return out.size();
}

template <Undo kUndo>
void add(H5Z_filter_t id, const char* name) {
  // HDF5 makes no dataset with a filter that says it cannot compress, even if its chunks come ready-made.
  const H5Z_class2_t filter = {H5Z_CLASS_T_VERS, id, 1, 1, name, nullptr, nullptr, run<kUndo>};
  H5Zregister(&filter);
}

}  // namespace

void register_hdf5_filters() {
  static std::once_flag once;
  std::call_once(once, [] {
    add<undo_lzf>(kLzf, "LZF");
    add<undo_blosc>(kBlosc, "Blosc");
    add<undo_lz4>(kLz4, "LZ4");
    add<undo_zstd>(kZstd, "Zstandard");
    add<undo_ecf>(kEcf, "ECF");
  });
}

Hdf5ChunkBytes::Hdf5ChunkBytes(std::size_t bytes) { chunk_bytes = bytes; }
Hdf5ChunkBytes::~Hdf5ChunkBytes() { chunk_bytes = 0; }

}  // namespace evpose
