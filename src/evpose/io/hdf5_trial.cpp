// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/io/hdf5_trial.h"

#include <hdf5.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <csignal>
#include <cstdio>
#include <deque>
#include <mutex>
#include <vector>

#include "evpose/io/hdf5_file.h"

namespace evpose {
namespace {

constexpr std::size_t kMostObjects = 2000;
constexpr std::size_t kLongestRow = 1 << 24;  // bytes

template <class Resource>
void limit(Resource resource, rlim_t most) {
  rlimit now{};
  if (::getrlimit(resource, &now) != 0) return;
  now.rlim_cur = std::min(most, now.rlim_max);
  ::setrlimit(resource, &now);
}

/// Of this process, bytes; 0: unknown.
rlim_t address_space() {
  long pages = 0;
  if (std::FILE* file = std::fopen("/proc/self/statm", "r")) {
    if (std::fscanf(file, "%ld", &pages) != 1) pages = 0;
    std::fclose(file);
  }
  return static_cast<rlim_t>(pages) * static_cast<rlim_t>(::sysconf(_SC_PAGESIZE));
}

bool survived(const std::function<void()>& what) {
  const pid_t child = ::fork();
  if (child < 0) return true;
  if (child == 0) {
    for (const int signal : {SIGSEGV, SIGBUS, SIGFPE, SIGILL, SIGABRT}) std::signal(signal, SIG_DFL);
    limit(RLIMIT_CORE, 0);
    limit(RLIMIT_CPU, 10);
    if (const rlim_t now = address_space(); now > 0) limit(RLIMIT_AS, now + (rlim_t{1} << 30));
    what();
    ::_exit(0);
  }
  int status = 0;
  while (::waitpid(child, &status, 0) < 0)
    if (errno != EINTR) return true;
  return WIFEXITED(status) && WEXITSTATUS(status) == 0;
}

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
  const hid_t space = H5Dget_space(dataset);
  H5Sselect_hyperslab(space, H5S_SELECT_SET, from.data(), nullptr, count.data(), nullptr);
  const hid_t memory = H5Screate_simple(static_cast<int>(count.size()), count.data(), nullptr);
  H5Dread(dataset, type, memory, space, H5P_DEFAULT, out);
}

}  // namespace

bool survives(const std::string& path, const std::function<void()>& what) {
  static std::mutex mutex;
  static std::deque<std::pair<Identity, bool>> tried;
  const std::lock_guard lock(mutex);
  const Identity file = identity(path);
  for (const auto& [which, verdict] : tried)
    if (which == file) return verdict;
  constexpr std::size_t kRemembered = 16;
  if (tried.size() == kRemembered) tried.pop_front();
  tried.emplace_back(file, survived(what));
  return tried.back().second;
}

// In a process that ends then: nothing is given back.
void Hdf5File::read_through() const {
  has("/no such object");
  root_groups();
  std::vector<std::pair<std::string, bool>> objects{{"/", false}};  // whether it is a dataset
  const auto visit = [](hid_t, const char* name, const H5O_info_t* info, void* out) -> herr_t {
    auto& list = *static_cast<decltype(objects)*>(out);
    list.emplace_back(std::string("/") + name, info->type == H5O_TYPE_DATASET);
    return list.size() < kMostObjects ? 0 : 1;
  };
  H5Ovisit2(id_.get(), H5_INDEX_NAME, H5_ITER_INC, visit, &objects, H5O_INFO_BASIC);
  for (const auto& [name, is_dataset] : objects) {
    has(name);
    for (const std::string& attribute : attributes(name)) {
      attribute_numbers(name, attribute);
      attribute_strings(name, attribute);
    }
    Hdf5Dataset dataset;
    if (!is_dataset || !open_dataset(name, -1, dataset)) continue;
    const hid_t id = dataset.id_.get(), type = H5Dget_type(id);
    const bool rows = H5Tget_class(type) == H5T_COMPOUND;
    if (rows ? !table(name, {}, 1) : !this->dataset(name)) continue;
    const hid_t native = H5Tget_native_type(type, H5T_DIR_ASCEND);
    auto bytes = static_cast<double>(std::max(H5Tget_size(native), H5Tget_size(type)));
    for (std::size_t i = 1; i < dataset.shape_.size(); ++i) bytes *= static_cast<double>(dataset.shape_[i]);
    if (native < 0 || !(bytes <= kLongestRow) || dataset.rows() == 0) continue;
    std::vector<char> row(static_cast<std::size_t>(bytes));
    read_row(id, native, 0, dataset.shape_, row.data());
    read_row(id, native, dataset.rows() - 1, dataset.shape_, row.data());
  }
}

}  // namespace evpose
