// SPDX-License-Identifier: BSD-3-Clause
// The first steps of map building by PCL, as a peer to time ours against (map_scale.py compiles and runs it):
// normals of the nearest points and region growing on them. Not part of the program.
#include <pcl/features/normal_3d_omp.h>
#include <pcl/io/ply_io.h>
#include <pcl/search/kdtree.h>
#include <pcl/segmentation/region_growing.h>

#include <chrono>
#include <cstdio>
#include <cstdlib>

int main(int argc, char** argv) {
  if (argc != 4) return std::fprintf(stderr, "pcl_planes CLOUD.ply NEIGHBOURS THREADS\n"), 2;
  const auto now = std::chrono::steady_clock::now;
  const pcl::PointCloud<pcl::PointXYZ>::Ptr cloud(new pcl::PointCloud<pcl::PointXYZ>);
  const auto start = now();
  if (pcl::io::loadPLYFile(argv[1], *cloud) != 0) return 2;
  const auto loaded = now();
  const pcl::search::KdTree<pcl::PointXYZ>::Ptr tree(new pcl::search::KdTree<pcl::PointXYZ>);
  const pcl::PointCloud<pcl::Normal>::Ptr normals(new pcl::PointCloud<pcl::Normal>);
  pcl::NormalEstimationOMP<pcl::PointXYZ, pcl::Normal> estimation(static_cast<unsigned>(std::atoi(argv[3])));
  estimation.setInputCloud(cloud);
  estimation.setSearchMethod(tree);
  estimation.setKSearch(std::atoi(argv[2]));
  estimation.compute(*normals);
  const auto described = now();
  pcl::RegionGrowing<pcl::PointXYZ, pcl::Normal> growing;
  growing.setInputCloud(cloud);
  growing.setInputNormals(normals);
  growing.setSearchMethod(tree);
  growing.setNumberOfNeighbours(12);     // as our links
  growing.setMinClusterSize(40);         // as our least plane
  growing.setSmoothnessThreshold(0.10F);  // rad, between neighbours; its tutorial's 3 degrees, doubled for noise
  growing.setCurvatureThreshold(0.05F);
  std::vector<pcl::PointIndices> regions;
  growing.extract(regions);
  const auto grown = now();
  std::size_t held = 0;
  for (const auto& region : regions) held += region.indices.size();
  const auto seconds = [](auto from, auto to) { return std::chrono::duration<double>(to - from).count(); };
  std::printf("%.2f %.2f %.2f %zu %.4f\n", seconds(start, loaded), seconds(loaded, described),
              seconds(described, grown), regions.size(),
              static_cast<double>(held) / static_cast<double>(cloud->size()));
}
