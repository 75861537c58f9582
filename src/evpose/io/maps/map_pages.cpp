// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/io/maps/map_pages.h"

#include <algorithm>

#include "evpose/io/maps/contour_completion.h"
#include "evpose/io/maps/map_columns.h"

namespace evpose {
namespace {

Error no_pages(const Hdf5File& file, const std::string& what) {
  return Error{file.path() + ": /pages", what, kMapDamaged};
}

/// Adds a page to the part of the map that is being read.
void append_page(const ContourMap& page, std::uint64_t first_point, ContourMap& part) {
  part.points.insert(part.points.end(), page.points.begin(), page.points.end());
  for (std::size_t i = 0; i < page.points.size(); ++i)
    part.numbers.push_back(static_cast<std::uint32_t>(first_point + i));
  const auto vertices = static_cast<std::uint32_t>(part.occluders.vertices.size());
  part.occluders.vertices.insert(part.occluders.vertices.end(), page.occluders.vertices.begin(),
                                 page.occluders.vertices.end());
  for (auto triangle : page.occluders.triangles) {
    for (std::uint32_t& corner : triangle) corner += vertices;
    part.occluders.triangles.push_back(triangle);
  }
}

}  // namespace

Expected<std::vector<MapFilePage>> read_map_pages(const Hdf5File& file) {
  std::vector<MapFilePage> pages;
  if (!file.has("/pages")) return pages;
  MapColumns columns(file);
  const auto crc = columns.column<std::uint32_t>("/pages/crc32", 1, -1);
  const auto count = static_cast<std::int64_t>(crc.size());
  const auto box = columns.column<float>("/pages/box", 4, count);
  std::array<std::vector<std::uint64_t>, kMapRowNames.size()> ends;
  for (std::size_t k = 0; k < ends.size(); ++k)
    ends[k] = columns.column<std::uint64_t>(text("/pages/", kMapRowNames[k], "_end"), 1, count);
  if (!columns.status()) return columns.status().error();
  pages.resize(crc.size());
  for (std::size_t i = 0; i < pages.size(); ++i) {
    MapFilePage& page = pages[i];
    page.crc = crc[i];
    page.low = {box[4 * i], box[4 * i + 1]};
    page.high = {box[4 * i + 2], box[4 * i + 3]};
    for (std::size_t k = 0; k < ends.size(); ++k) {
      page.first[k] = i == 0 ? 0 : pages[i - 1].end[k];
      page.end[k] = ends[k][i];
      if (page.end[k] < page.first[k]) return no_pages(file, text("page ", i, " ends before it begins"));
    }
  }
  const auto xyz = file.dataset("/points/xyz", 2);
  if (!xyz) return xyz.error();
  if (!pages.empty() && pages.back().end_of(MapRows::points) != xyz->rows())
    return no_pages(file, text("the last page ends before the last of ", xyz->rows(), " points"));
  return pages;
}

Expected<MapPages> MapPages::open(const std::string& path) {
  auto file = Hdf5File::open(path);
  if (!file) return file.error();
  ContourMap map;
  if (const auto status = read_map_meta(*file, map); !status) return status.error();
  auto pages = read_map_pages(*file);
  if (!pages) return pages.error();
  return MapPages(*std::move(file), *std::move(pages));
}

Expected<std::shared_ptr<const ContourMap>> MapPages::around(const Eigen::Vector3d& place_map,
                                                             double radius_m) const {
  auto part = std::make_shared<ContourMap>();
  part->source = file_.path();
  if (const auto status = read_map_meta(file_, *part); !status) return status.error();
  const Eigen::Vector2f place = (place_map - part->anchor).head<2>().cast<float>();
  for (const MapFilePage& page : pages_) {
    const Eigen::Vector2f beyond = (page.low - place).cwiseMax(place - page.high).cwiseMax(0.0F);
    if (static_cast<double>(beyond.norm()) > radius_m || page.count_of(MapRows::points) == 0) continue;
    auto read = read_map_page(file_, page);
    if (!read) return read.error();
    const std::size_t points = read->points.size();
    if (const auto status = complete_contours(*read); !status) return status.error();
    if (read->points.size() != points)
      return Error{file_.path(), "some points have no tangent", "build the map again"};
    append_page(*read, page.first_of(MapRows::points), *part);
  }
  return std::shared_ptr<const ContourMap>(std::move(part));
}

}  // namespace evpose
