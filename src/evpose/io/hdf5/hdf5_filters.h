// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>

namespace evpose {

/// Makes the HDF5 library able to read chunks compressed by Blosc, Zstandard, LZ4, LZF and Metavision's ECF,
/// without plug-ins. May be called any number of times.
void register_hdf5_filters();

/// HDF5 trusts a filter to return a whole chunk but does not tell it how large that is. While one of these
/// lives, the filters above refuse, on this thread, chunks that come out smaller or much larger.
class Hdf5ChunkBytes {
 public:
  explicit Hdf5ChunkBytes(std::size_t bytes);
  Hdf5ChunkBytes(const Hdf5ChunkBytes&) = delete;
  Hdf5ChunkBytes& operator=(const Hdf5ChunkBytes&) = delete;
  ~Hdf5ChunkBytes();
};

}  // namespace evpose
