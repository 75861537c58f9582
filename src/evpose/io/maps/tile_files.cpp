// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/io/maps/tile_files.h"

#include <array>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <utility>

#include "evpose/io/files/atomic_file.h"
#include "evpose/io/files/yaml_document.h"
#include "evpose/io/maps/ply.h"

namespace evpose {
namespace {

constexpr std::size_t kBuffer = 1 << 18;  // bytes of a tile that are kept until they are written
constexpr int kVersion = 1;
const std::string kPlanName = "plan.yaml";
const std::string kPlanAgain = "plan again: `evpose map build CLOUD --plan FOLDER`";

std::string tile_name(std::size_t tile, const char* ending) { return text("tile_", tile, ending); }

/// Of fixed length, so that the number of points can be put in later.
std::string cloud_header(std::size_t points, bool brightness) {
  std::string count = std::to_string(points);
  count.insert(0, 20 - count.size(), '0');
  return "ply\nformat binary_little_endian 1.0\ncomment tile of a cloud, relative to the anchor in " +
         kPlanName + "\nelement vertex " + count +
         "\nproperty float x\nproperty float y\nproperty float z\n" +
         (brightness ? "property uchar intensity\n" : "") + "end_header\n";
}

struct Close {
  void operator()(std::FILE* file) const { std::fclose(file); }
};

/// Writes at the end of a file, or over its beginning.
Status put_into(const std::string& path, const char* mode, const std::string& bytes) {
  std::unique_ptr<std::FILE, Close> file(std::fopen(path.c_str(), mode));
  const bool written = file != nullptr &&
                       std::fwrite(bytes.data(), 1, bytes.size(), file.get()) == bytes.size() &&
                       std::fflush(file.get()) == 0;
  if (written) return {};
  return Error{path, text("cannot be written: ", std::strerror(errno)),
               "make room, or choose another folder"};
}

std::string plan_text(const TilePlan& plan) {
  const auto number = [](double v) {
    std::array<char, 40> digits{};
    std::snprintf(digits.data(), digits.size(), "%.17g", v);
    return std::string(digits.data());
  };
  std::string out = text("format: evpose-tiles\nversion: ", kVersion, "\ncloud: '");
  for (const char c : plan.cloud) out += c == '\'' ? std::string("''") : std::string(1, c);
  out += "'\nanchor: [" + number(plan.anchor.x()) + ", " + number(plan.anchor.y()) + ", " +
         number(plan.anchor.z()) +
         "]  # m\ntiles:  # low x, y, high x, y, overlap (m, relative to the anchor), points\n";
  for (std::size_t k = 0; k < plan.tiles.size(); ++k) {
    const CloudTile& tile = plan.tiles[k];
    out += "  - [";
    for (const float v : {tile.low.x(), tile.low.y(), tile.high.x(), tile.high.y(), tile.overlap_m})
      out += number(static_cast<double>(v)) + ", ";
    out += text(plan.points[k], "]\n");
  }
  return out;
}

Status read_tiles(const YamlDocument& document, const YamlNode& list, TilePlan& plan) {
  for (const YamlNode& item : list.items) {
    const auto numbers = document.numbers(item, "tiles", 6);
    if (!numbers) return numbers.error();
    std::array<float, 5> v{};
    for (std::size_t k = 0; k < v.size(); ++k) v[k] = static_cast<float>((*numbers)[k]);
    if (!((*numbers)[5] >= 0 && (*numbers)[5] < 1e15 && v[4] >= 0))
      return document.error(item, "a tile of this overlap and number of points cannot be", kPlanAgain);
    plan.tiles.push_back({{v[0], v[1]}, {v[2], v[3]}, v[4]});
    plan.points.push_back(static_cast<std::size_t>((*numbers)[5]));
  }
  if (plan.tiles.empty()) return document.error(list, "lists no tile", kPlanAgain);
  return {};
}

}  // namespace

std::string TilePlan::cloud_of(std::size_t tile) const { return folder + "/" + tile_name(tile, ".ply"); }
std::string TilePlan::map_of(std::size_t tile) const { return folder + "/" + tile_name(tile, ".h5"); }

Expected<TilePlan> read_tile_plan(const std::string& folder) {
  const std::string path = folder + "/" + kPlanName;
  if (std::error_code ignored; !std::filesystem::exists(path, ignored))
    return Error{folder, "is no folder of tiles: it has no " + kPlanName,
                 "make one: `evpose map build CLOUD --plan FOLDER`"};
  const auto document = YamlDocument::read(path);
  if (!document) return document.error();
  const auto member = [&](const char* key) {
    const YamlNode* found = document->root.find(key);
    return found == nullptr ? YamlNode{} : *found;
  };
  const auto format = document->string(member("format"), "format");
  const auto version = document->integer(member("version"), "version");
  if (!format || *format != "evpose-tiles" || !version || *version != kVersion)
    return Error{path, "is no plan that this program knows", kPlanAgain};
  TilePlan plan;
  plan.folder = folder;
  const auto cloud = document->string(member("cloud"), "cloud");
  if (!cloud) return cloud.error();
  plan.cloud = *cloud;
  const auto anchor = document->numbers(member("anchor"), "anchor", 3);
  if (!anchor) return anchor.error();
  plan.anchor = {(*anchor)[0], (*anchor)[1], (*anchor)[2]};
  if (const Status done = read_tiles(*document, member("tiles"), plan); !done) return done.error();
  return plan;
}

Expected<PointCloud> read_tile_cloud(const TilePlan& plan, std::size_t tile) {
  const std::string path = plan.cloud_of(tile);
  PointCloud cloud;
  cloud.source = path;
  cloud.anchor = plan.anchor;
  const Status read = visit_ply_vertices(path, [&](const PointTable& block) {
    const auto *x = block.find("x"), *y = block.find("y"), *z = block.find("z");
    const auto* brightness = block.find("intensity");
    if (x == nullptr || y == nullptr || z == nullptr)
      return Status(Error{path, "no columns x, y and z", kPlanAgain});
    for (std::size_t i = 0; i < block.rows(); ++i) {
      cloud.points.push_back(Eigen::Vector3d((*x)[i], (*y)[i], (*z)[i]).cast<float>());
      if (!cloud.points.back().allFinite()) return Status(Error{path, "a point is not finite", kPlanAgain});
      if (brightness != nullptr) cloud.brightness.push_back(static_cast<std::uint8_t>((*brightness)[i]));
    }
    return Status();
  });
  if (!read) return read.error();
  if (cloud.points.size() != plan.points[tile])
    return Error{path, text("has ", cloud.points.size(), " points, the plan says ", plan.points[tile]),
                 kPlanAgain};
  return cloud;
}

Expected<TileCloudWriter> TileCloudWriter::create(TilePlan plan, bool brightness,
                                                  const std::string& settings) {
  if (std::error_code ignored; std::filesystem::exists(plan.folder, ignored))
    return Error{plan.folder, "is there already", "give another name, or remove it"};
  auto folder = NewFolder::create(plan.folder, kPlanName);
  if (!folder) return folder.error();
  if (const Status done = write_text_file(folder->path("settings.yaml"), settings); !done)
    return done.error();
  TileCloudWriter writer(std::move(plan), brightness, *std::move(folder));
  for (std::size_t k = 0; k < writer.rows_.size(); ++k) writer.rows_[k] = cloud_header(0, brightness);
  return writer;
}

TileCloudWriter::TileCloudWriter(TilePlan plan, bool brightness, NewFolder folder)
    : plan_(std::move(plan)), brightness_(brightness), folder_(std::move(folder)), rows_(plan_.tiles.size()) {
  plan_.points.assign(plan_.tiles.size(), 0);
}

Status TileCloudWriter::flush(std::size_t tile) {
  const Status done = put_into(folder_.path(tile_name(tile, ".ply")), "ab", rows_[tile]);
  rows_[tile].clear();
  return done;
}

Status TileCloudWriter::add(const PointCloud& block) {
  std::array<char, 3 * sizeof(float)> row{};
  for (std::size_t i = 0; i < block.points.size(); ++i) {
    std::memcpy(row.data(), block.points[i].data(), row.size());
    for (std::size_t k = 0; k < plan_.tiles.size(); ++k) {
      if (!plan_.tiles[k].holds(block.points[i], plan_.tiles[k].overlap_m)) continue;
      rows_[k].append(row.data(), row.size());
      if (brightness_) rows_[k].push_back(static_cast<char>(block.brightness[i]));
      ++plan_.points[k];
      if (rows_[k].size() < kBuffer) continue;
      if (const Status done = flush(k); !done) return done;
    }
  }
  return {};
}

Expected<TilePlan> TileCloudWriter::commit() {
  for (std::size_t k = 0; k < plan_.tiles.size(); ++k) {
    Status done = flush(k);
    if (done)
      done = put_into(folder_.path(tile_name(k, ".ply")), "r+b", cloud_header(plan_.points[k], brightness_));
    if (!done) return done.error();
  }
  if (const Status done = write_text_file(folder_.path(kPlanName), plan_text(plan_)); !done)
    return done.error();
  if (const Status done = folder_.commit(); !done) return done.error();
  return plan_;
}

}  // namespace evpose
