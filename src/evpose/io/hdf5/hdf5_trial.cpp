// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/io/hdf5/hdf5_trial.h"

#include <hdf5.h>
#include <sys/stat.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <deque>
#include <mutex>
#include <optional>
#include <utility>
#include <vector>

#include "evpose/io/files/child_process.h"
#include "evpose/io/files/input_file.h"
#include "evpose/io/hdf5/hdf5_file.h"
#include "evpose/io/hdf5/hdf5_headers.h"

namespace evpose {
namespace {

constexpr std::size_t kMostObjects = 2000;
constexpr std::size_t kLongestRow = 1 << 24;  // bytes

/// What changes with a file's content.
using Identity = std::array<std::int64_t, 5>;

Identity identity(const std::string& path) {
  struct stat info {};
  if (::stat(path.c_str(), &info) != 0) return {};
  return {static_cast<std::int64_t>(info.st_dev), static_cast<std::int64_t>(info.st_ino), info.st_size,
          info.st_mtim.tv_sec, info.st_mtim.tv_nsec};
}

void read_row(hid_t dataset, hid_t type, hsize_t row, const Hdf5Shape& shape, void* out) {
  if (shape.empty()) {
    H5Dread(dataset, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, out);
    return;
  }
  std::vector<hsize_t> from(shape.size(), 0), count(shape.begin(), shape.end());
  from[0] = row;
  count[0] = 1;
  const Hdf5Handle space{H5Dget_space(dataset), H5Sclose};
  H5Sselect_hyperslab(space.get(), H5S_SELECT_SET, from.data(), nullptr, count.data(), nullptr);
  const Hdf5Handle memory{H5Screate_simple(static_cast<int>(count.size()), count.data(), nullptr), H5Sclose};
  H5Dread(dataset, type, memory.get(), space.get(), H5P_DEFAULT, out);
}

struct Trial {
  bool (*work)(const std::string& path);
  const std::string& path;
  std::optional<bool> survived;
};

/// The library has one lock for all threads. A child that is born while another thread holds it waits for it
/// forever, so this thread has to hold it then, which it does in whatever the library calls.
bool survives_holding_the_lock(const std::string& path, bool (*work)(const std::string& path)) {
  Trial trial{work, path, {}};
  const auto in_library = [](hid_t, const char*, void* data) -> herr_t {
    auto& t = *static_cast<Trial*>(data);
    t.survived = child_survives(t.work, t.path);
    return 1;  // that was all
  };
  const Hdf5Handle any{H5Pcreate(H5P_FILE_ACCESS), H5Pclose};
  H5Piterate(any.get(), nullptr, in_library, &trial);
  return trial.survived.value_or(true);
}

}  // namespace

bool survives(const std::string& path, bool (*work)(const std::string& path)) {
  static std::mutex mutex;
  static std::deque<std::pair<Identity, bool>> tried;
  const std::lock_guard lock(mutex);
  const Identity file = identity(path);
  for (const auto& [which, verdict] : tried)
    if (which == file) return verdict;
  constexpr std::size_t kRemembered = 16;
  if (tried.size() == kRemembered) tried.pop_front();
  tried.emplace_back(file, survives_holding_the_lock(path, work));
  return tried.back().second;
}

bool Hdf5File::read_through(const std::string& path) {
  const Hdf5File file = opened(path);
  if (!file.id_) return false;
  file.has("/no such object");
  file.root_groups();
  struct Object {
    std::string name;
    bool is_dataset;
    haddr_t header;
  };
  std::vector<Object> objects;
  const auto visit = [](hid_t, const char* name, const H5O_info_t* info, void* out) -> herr_t {
    auto& list = *static_cast<std::vector<Object>*>(out);
    const std::string full = list.empty() ? "/" : std::string("/") + name;  // the first is the root
    list.push_back({full, info->type == H5O_TYPE_DATASET, info->addr});
    return list.size() < kMostObjects ? 0 : 1;
  };
  // What cannot be listed may still be found by name, untried.
  if (H5Ovisit2(file.id_.get(), H5_INDEX_NAME, H5_ITER_INC, visit, &objects, H5O_INFO_BASIC) < 0)
    return false;
  const auto plain = open_to_read(path);
  const Hdf5Handle creation{H5Fget_create_plist(file.id_.get()), H5Pclose};
  hsize_t before = 0;
  if (!plain || H5Pget_userblock(creation.get(), &before) < 0) return false;
  for (const auto& [name, is_dataset, header] : objects) {
    if (!messages_are_sound(plain->stream.get(), static_cast<std::uint64_t>(plain->size), before, header))
      return false;
    file.has_attribute(name, "no such attribute");  // looks at all, even where they cannot be counted
    for (const std::string& attribute : file.attributes(name)) {
      file.attribute_numbers(name, attribute);
      file.attribute_strings(name, attribute);
    }
    if (!is_dataset) continue;
    auto dataset = file.dataset(name);
    if (!dataset) dataset = file.table(name, {}, 1);
    if (!dataset) continue;
    const hid_t id = dataset->id_.get();
    const Hdf5Handle type{H5Dget_type(id), H5Tclose};
    const Hdf5Handle native{H5Tget_native_type(type.get(), H5T_DIR_ASCEND), H5Tclose};
    auto bytes = static_cast<double>(std::max(H5Tget_size(native.get()), H5Tget_size(type.get())));
    for (std::size_t i = 1; i < dataset->shape_.size(); ++i) bytes *= static_cast<double>(dataset->shape_[i]);
    if (!native || !(bytes <= kLongestRow) || dataset->rows() == 0) continue;
    std::vector<char> row(static_cast<std::size_t>(bytes));
    read_row(id, native.get(), 0, dataset->shape_, row.data());
    read_row(id, native.get(), dataset->rows() - 1, dataset->shape_, row.data());
  }
  return true;
}

}  // namespace evpose
