// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/sim/recording/world_cache.h"

#include <cstdio>
#include <cstring>
#include <filesystem>
#include <span>
#include <type_traits>

#include "evpose/core/version.h"
#include "evpose/io/files/atomic_file.h"
#include "evpose/io/files/binary_file.h"
#include "evpose/io/files/crc32.h"
#include "evpose/io/files/new_folder.h"
#include "evpose/sim/light/lighting.h"

namespace evpose::sim {
namespace {

namespace fs = std::filesystem;

constexpr const char *kLight = "light.bin", *kContours = "contours.ply", *kMesh = "mesh.ply";
constexpr std::uint32_t kMagic = 0x31574345;  // "ECW1"

/// Fowler, Noll and Vo's hash, FNV-1a, of 64 bits.
class Hash {
 public:
  template <class T>
  void add(const T& value) {
    static_assert(std::is_arithmetic_v<T> || std::is_enum_v<T>);
    add_bytes(&value, sizeof value);
  }
  template <class T, int rows>
  void add(const Eigen::Matrix<T, rows, 1>& vector) {
    for (const T value : vector) add(value);
  }
  template <class T, std::size_t n>
  void add(const std::array<T, n>& values) {
    for (const T& value : values) add(value);
  }
  template <class T>
  void add(const std::vector<T>& values) {
    add(values.size());
    for (const T& value : values) add(value);
  }
  void add_bytes(const void* data, std::size_t size) {
    for (const unsigned char byte : std::span(static_cast<const unsigned char*>(data), size))
      state_ = (state_ ^ byte) * 0x100000001b3ULL;
  }
  std::uint64_t value() const { return state_; }

 private:
  std::uint64_t state_ = 0xcbf29ce484222325ULL;
};

void add_program(Hash& hash) {
  hash.add_bytes(version(), std::strlen(version()));
  std::error_code none;
  const fs::path program = fs::read_symlink("/proc/self/exe", none);
  hash.add(static_cast<std::uint64_t>(fs::file_size(program, none)));
  hash.add(static_cast<std::int64_t>(fs::last_write_time(program, none).time_since_epoch().count()));
}

std::uint64_t key_of(const Scene& scene, double contour_spacing_m) {
  Hash hash;
  add_program(hash);
  const Mesh& mesh = scene.mesh;
  hash.add(mesh.vertices), hash.add(mesh.triangles), hash.add(mesh.uv), hash.add(mesh.normals);
  hash.add(mesh.material), hash.add(mesh.object);
  hash.add(scene.low), hash.add(scene.high);
  for (const Light& light : scene.lights) {
    hash.add(light.kind), hash.add(light.strength), hash.add(light.direction), hash.add(light.position);
    hash.add(light.radius);
  }
  const LightChannels channels = light_channels(scene);
  hash.add(channels.switching.size()), hash.add(channels.of_light);
  hash.add(contour_spacing_m);
  return hash.value();
}

struct LightHead {
  std::uint32_t magic = kMagic, patches = 0;
  std::uint64_t key = 0, contour_points = 0;
};

struct MapHead {
  double right[3], up[3], right0, up0, per_metre;
  std::int32_t columns, rows;
  std::uint64_t values;
};

template <class T>
std::string_view bytes_of(const T& value) {
  return {reinterpret_cast<const char*>(&value), sizeof value};
}

class CheckedWriter {
 public:
  explicit CheckedWriter(AtomicFile& file) : file_(file) {}
  void write(std::string_view bytes) {
    crc_ = crc32(bytes.data(), bytes.size(), crc_);
    file_.write(bytes);
  }
  void finish() { file_.write(bytes_of(crc_)); }

 private:
  AtomicFile& file_;
  std::uint32_t crc_ = 0;
};

class CheckedReader {
 public:
  explicit CheckedReader(BinaryFile& file) : file_(file) {}
  /// False where the file ends before.
  bool read(void* to, std::size_t size) {
    const auto done = file_.read(size, room_);
    if (!done || !*done) return false;
    std::memcpy(to, room_.data(), size);
    crc_ = crc32(to, size, crc_);
    return true;
  }
  bool finish() {
    const std::uint32_t crc = crc_;
    std::uint32_t stored = 0;
    return read(&stored, sizeof stored) && file_.left() == 0 && crc32_agrees(stored, crc);
  }

 private:
  BinaryFile& file_;
  std::vector<std::byte> room_;
  std::uint32_t crc_ = 0;
};

Status write_light(const std::string& path, LightHead head, const PartSurfaces& still) {
  auto file = AtomicFile::create(path);
  if (!file) return file.error();
  CheckedWriter out(*file);
  head.patches = static_cast<std::uint32_t>(still.patches.size());
  out.write(bytes_of(head));
  for (const Patch& patch : still.patches) {
    const LightMap& map = patch.light;
    MapHead mine{{}, {}, map.right0, map.up0, map.per_metre, map.columns, map.rows, map.values.size()};
    Eigen::Vector3d::Map(mine.right) = map.right;
    Eigen::Vector3d::Map(mine.up) = map.up;
    out.write(bytes_of(mine));
    out.write({reinterpret_cast<const char*>(map.values.data()), map.values.size() * sizeof(float)});
  }
  out.finish();
  return file->commit();
}

std::optional<WorldCache::World> read_light(const std::string& path, std::uint64_t key) {
  auto file = BinaryFile::open(path);
  if (!file) return {};
  CheckedReader in(*file);
  LightHead head;
  if (!in.read(&head, sizeof head) || head.magic != kMagic || head.key != key) return {};
  WorldCache::World out;
  out.contour_points = head.contour_points;
  for (std::uint32_t k = 0; k < head.patches; ++k) {
    MapHead mine;
    if (!in.read(&mine, sizeof mine) || mine.values > file->left() / sizeof(float)) return {};
    LightMap& map = out.light.emplace_back();
    map.right = Eigen::Vector3d::Map(mine.right);
    map.up = Eigen::Vector3d::Map(mine.up);
    map.right0 = mine.right0, map.up0 = mine.up0, map.per_metre = mine.per_metre;
    map.columns = mine.columns, map.rows = mine.rows;
    map.values.resize(mine.values);
    if (!in.read(map.values.data(), mine.values * sizeof(float))) return {};
  }
  return in.finish() ? std::optional(std::move(out)) : std::nullopt;
}

std::string folder_of(const std::string& folder, std::uint64_t key) {
  char name[17];
  std::snprintf(name, sizeof name, "%016llx", static_cast<unsigned long long>(key));
  return folder + "/" + name;
}

}  // namespace

std::optional<WorldCache::World> WorldCache::find(const Scene& scene, double contour_spacing_m) const {
  if (folder_.empty()) return {};
  const std::uint64_t key = key_of(scene, contour_spacing_m);
  const std::string mine = folder_of(folder_, key);
  auto out = read_light(mine + "/" + kLight, key);
  if (!out) return {};
  out->contours = mine + "/" + kContours;
  out->mesh = mine + "/" + kMesh;
  return out;
}

Status WorldCache::keep(const Scene& scene, double contour_spacing_m, const PartSurfaces& still,
                        const World& files) const {
  if (folder_.empty()) return {};
  LightHead head;
  head.key = key_of(scene, contour_spacing_m);
  head.contour_points = files.contour_points;
  auto folder = NewFolder::create(folder_of(folder_, head.key), kLight);
  if (!folder) return folder.error();
  for (const auto& [from, name] : {std::pair(&files.contours, kContours), {&files.mesh, kMesh}}) {
    std::error_code failed;
    fs::copy_file(*from, folder->path(name), failed);
    if (failed)
      return Error{folder_, failed.message(), "name a folder with room, or leave out --world-cache"};
  }
  if (auto done = write_light(folder->path(kLight), head, still); !done) return done;
  return folder->commit();
}

}  // namespace evpose::sim
