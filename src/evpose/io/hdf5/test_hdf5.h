// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <gtest/gtest.h>
#include <hdf5.h>

#include <algorithm>
#include <cstring>
#include <functional>
#include <string>
#include <vector>

namespace evpose {

/// What becomes of the bytes of a chunk.
using Packing = std::function<std::string(const std::string&)>;

/// A file whose chunks are written as they shall stand there.
class ForeignFile {
 public:
  explicit ForeignFile(const std::string& path)
      : path_(path), file_(H5Fcreate(path.c_str(), H5F_ACC_TRUNC, H5P_DEFAULT, H5P_DEFAULT)) {
    EXPECT_GE(file_, 0);
  }
  ForeignFile(const ForeignFile&) = delete;
  ForeignFile& operator=(const ForeignFile&) = delete;
  ~ForeignFile() { close(); }
  void close() {
    if (file_ >= 0) H5Fclose(file_);
    file_ = -1;
  }

  template <class T>
  void put(const std::string& name, hid_t type, const std::vector<T>& rows, H5Z_filter_t filter = 0,
           const Packing& pack = nullptr, hsize_t chunk = 1000, std::vector<unsigned> parameters = {}) {
    const hsize_t count = rows.size();
    const hid_t space = H5Screate_simple(1, &count, nullptr), properties = H5Pcreate(H5P_DATASET_CREATE),
                links = H5Pcreate(H5P_LINK_CREATE);
    H5Pset_create_intermediate_group(links, 1);
    if (filter != 0) {
      H5Pset_chunk(properties, 1, &chunk);
      H5Pset_filter(properties, filter, H5Z_FLAG_OPTIONAL, parameters.size(), parameters.data());
    }
    const hid_t set = H5Dcreate2(file_, name.c_str(), type, space, links, properties, H5P_DEFAULT);
    ASSERT_GE(set, 0);
    if (filter == 0) {
      EXPECT_GE(H5Dwrite(set, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, rows.data()), 0);
    }
    for (hsize_t at = 0; filter != 0 && at < count; at += chunk) {
      std::string bytes(chunk * sizeof(T), '\0');
      std::memcpy(bytes.data(), rows.data() + at, std::min<std::size_t>(chunk, count - at) * sizeof(T));
      const std::string packed = pack(bytes);
      EXPECT_GE(H5Dwrite_chunk(set, H5P_DEFAULT, 0, &at, packed.size(), packed.data()), 0);
    }
    H5Dclose(set), H5Pclose(links), H5Pclose(properties), H5Sclose(space);
  }

  void put_text(const char* name, const std::string& value) {
    const hid_t type = H5Tcopy(H5T_C_S1), space = H5Screate(H5S_SCALAR);
    H5Tset_size(type, H5T_VARIABLE);
    const hid_t attribute = H5Acreate2(file_, name, type, space, H5P_DEFAULT, H5P_DEFAULT);
    const char* pointer = value.c_str();
    EXPECT_GE(H5Awrite(attribute, type, static_cast<const void*>(&pointer)), 0);
    H5Aclose(attribute), H5Sclose(space), H5Tclose(type);
  }

  void put_matrix(const std::string& name, const std::vector<double>& values, hsize_t columns) {
    const hsize_t shape[] = {values.size() / columns, columns};
    const hid_t space = H5Screate_simple(2, shape, nullptr), links = H5Pcreate(H5P_LINK_CREATE);
    H5Pset_create_intermediate_group(links, 1);
    const hid_t set =
        H5Dcreate2(file_, name.c_str(), H5T_NATIVE_DOUBLE, space, links, H5P_DEFAULT, H5P_DEFAULT);
    EXPECT_GE(H5Dwrite(set, H5T_NATIVE_DOUBLE, H5S_ALL, H5S_ALL, H5P_DEFAULT, values.data()), 0);
    H5Dclose(set), H5Pclose(links), H5Sclose(space);
  }

 private:
  std::string path_;
  hid_t file_;
};

}  // namespace evpose
