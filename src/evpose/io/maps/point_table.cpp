// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/io/maps/point_table.h"

#include "evpose/io/files/input_file.h"

namespace evpose {

Expected<PointFileKind> point_file_kind(const std::string& path) {
  const auto head = first_bytes(path, 8);
  if (!head) return head.error();
  if (head->empty()) return Error{path, "the file is empty", "copy it again"};
  if (head->starts_with("ply") || path.ends_with(".ply")) return PointFileKind::ply;
  if (head->starts_with("LASF")) return PointFileKind::las;
  if (head->starts_with("\x89HDF") || path.ends_with(".h5")) return PointFileKind::hdf5;
  if (head->starts_with("# .PCD") || head->starts_with("VERSION") || path.ends_with(".pcd"))
    return PointFileKind::pcd;
  return PointFileKind::other;
}

Expected<PointTable> joined_blocks(const std::function<Status(const PointBlocks&)>& read) {
  PointTable all;
  const Status done = read([&](const PointTable& block) {
    all.names = block.names;
    all.viewpoint = block.viewpoint;
    all.columns.resize(block.columns.size());
    for (std::size_t k = 0; k < block.columns.size(); ++k)
      all.columns[k].insert(all.columns[k].end(), block.columns[k].begin(), block.columns[k].end());
    return Status();
  });
  if (!done) return done.error();
  return all;
}

}  // namespace evpose
