// SPDX-License-Identifier: BSD-3-Clause
// Decoders of pieces of files.
#include <hdf5.h>

#include <algorithm>
#include <iterator>
#include <string>

#include "evpose/core/error.h"
#include "evpose/io/events/evt3.h"
#include "evpose/io/hdf5/ecf.h"
#include "evpose/io/hdf5/hdf5_filters.h"
#include "fuzz.h"

namespace evpose::fuzz {
namespace {

struct Decoded {
  std::vector<std::int64_t> t_us;
  std::vector<std::uint64_t> events;
  std::vector<Trigger> triggers;
};

void decode(Evt3Decoder& decoder, std::span<const std::byte> bytes, Decoded& out) {
  EventBlock block;
  while (true) {
    block.start();
    const std::size_t used = decoder.decode(bytes, block, &out.triggers);
    bytes = bytes.subspan(used);
    for (std::size_t i = 0; i < block.count; ++i) {
      EVPOSE_CHECK(out.t_us.empty() || block.time_us(i) >= out.t_us.back());
      out.t_us.push_back(block.time_us(i));
      const Event& e = block.events[i];
      out.events.push_back(event_bits(0, e.x, e.y, e.on));
    }
    if (used == 0) return;
  }
}

constexpr hsize_t kRows = 64;

/// A dataset of one chunk of 64 stamps behind a filter, in a file in memory that lives as long as we do.
hid_t dataset_behind(H5Z_filter_t filter) {
  static const hid_t file = [] {
    const hid_t access = H5Pcreate(H5P_FILE_ACCESS);
    H5Pset_fapl_core(access, 64 << 10, false);
    return H5Fcreate("fuzz.h5", H5F_ACC_TRUNC, H5P_DEFAULT, access);
  }();
  const hid_t space = H5Screate_simple(1, &kRows, nullptr), properties = H5Pcreate(H5P_DATASET_CREATE);
  const unsigned parameters[] = {4, 0, kRows * 8};
  H5Pset_chunk(properties, 1, &kRows);
  H5Pset_filter(properties, filter, H5Z_FLAG_OPTIONAL, 3, parameters);
  const std::string name = "/" + std::to_string(filter);
  const hid_t set =
      H5Dcreate2(file, name.c_str(), H5T_NATIVE_INT64, space, H5P_DEFAULT, properties, H5P_DEFAULT);
  H5Pclose(properties), H5Sclose(space);
  EVPOSE_CHECK(set >= 0);
  return set;
}

/// The chunk, whatever it is said to hold, by way of the HDF5 library.
void read_chunk(hid_t set, Bytes chunk) {
  const hsize_t start = 0;
  EVPOSE_CHECK(H5Dwrite_chunk(set, H5P_DEFAULT, 0, &start, chunk.size(), chunk.data()) >= 0);
  std::int64_t out[kRows];
  const Hdf5ChunkBytes bytes(kRows * 8);
  H5Dread(set, H5T_NATIVE_INT64, H5S_ALL, H5S_ALL, H5P_DEFAULT, out);
}

}  // namespace
}  // namespace evpose::fuzz

EVPOSE_FUZZ_TARGET(ecf) {
  std::vector<evpose::EcfEvent> events;
  evpose::decode_ecf(std::as_bytes(bytes), events);
}

/// Fed in two pieces it gives what it gives in one.
EVPOSE_FUZZ_TARGET(evt3_pieces) {
  using namespace evpose;
  if (bytes.size() < 2) return;
  const auto words = std::as_bytes(bytes.subspan(1));
  const std::size_t cut = std::min<std::size_t>(2 * std::size_t{bytes[0]}, words.size() / 2 * 2);
  Evt3Decoder whole({640, 480}), pieces({640, 480});
  fuzz::Decoded a, b;
  fuzz::decode(whole, words, a);
  fuzz::decode(pieces, words.first(cut), b);
  fuzz::decode(pieces, words.subspan(cut), b);
  EVPOSE_CHECK(a.t_us == b.t_us && a.events == b.events && a.triggers.size() == b.triggers.size());
}

EVPOSE_FUZZ_TARGET(hdf5_chunks) {
  constexpr H5Z_filter_t kFilters[] = {32000, 32001, 32004, 32015, 0x8ECF};
  if (bytes.size() < 2) return;
  static hid_t sets[std::size(kFilters)] = {};
  if (sets[0] == 0) {
    H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr);
    evpose::register_hdf5_filters();
    for (std::size_t i = 0; i < std::size(kFilters); ++i) sets[i] = evpose::fuzz::dataset_behind(kFilters[i]);
  }
  evpose::fuzz::read_chunk(sets[bytes[0] % std::size(kFilters)], bytes.subspan(1));
}
