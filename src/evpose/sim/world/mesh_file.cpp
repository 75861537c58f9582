// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/sim/world/mesh_file.h"

#include <assimp/config.h>
#include <assimp/postprocess.h>
#include <assimp/scene.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <assimp/Importer.hpp>
#include <cctype>
#include <cmath>
#include <map>
#include <numbers>
#include <vector>

#include "evpose/io/files/atomic_file.h"
#include "evpose/io/maps/ply.h"

namespace evpose::sim {
namespace {

constexpr std::size_t kMostBytes = 256u << 20;
constexpr std::size_t kMostTriangles = 5'000'000;
constexpr double kFarthest_m = 1e5;  // beyond, floats are coarser than a centimetre
constexpr double kSmoothingAngle = 40 * std::numbers::pi / 180;

std::string extension(const std::string& path) {
  const std::size_t dot = path.find_last_of('.');
  std::string ending = dot == std::string::npos ? "" : path.substr(dot + 1);
  std::transform(ending.begin(), ending.end(), ending.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return ending;
}

// Laid on along the axis that the triangle faces most.
Eigen::Vector2f along_axes(const Eigen::Vector3d& p, const Eigen::Vector3d& normal) {
  int axis = 0;
  normal.cwiseAbs().maxCoeff(&axis);
  const double sign = normal[axis] < 0 ? -1 : 1;
  if (axis == 0) return Eigen::Vector2d(sign * p.y(), p.z()).cast<float>();
  if (axis == 1) return Eigen::Vector2d(-sign * p.x(), p.z()).cast<float>();
  return Eigen::Vector2d(sign * p.x(), p.y()).cast<float>();
}

/// A mesh as the file has it.
struct RawMesh {
  std::vector<Eigen::Vector3d> vertices;
  std::vector<Mesh::Corners> triangles;
  std::vector<std::array<Eigen::Vector2d, 3>> uv;  // of each triangle, or none
};

Expected<RawMesh> read_ply(const std::string& path) {
  const auto file = read_ply_mesh(path, Eigen::Vector3d::Zero());
  if (!file) return file.error();
  RawMesh raw;
  for (const Eigen::Vector3f& v : file->vertices) raw.vertices.push_back(v.cast<double>());
  raw.triangles = file->triangles;
  return raw;
}

Expected<RawMesh> read_obj(const std::string& path) {
  const auto content = read_text_file(path, kMostBytes);
  if (!content) return content.error();
  Assimp::Importer importer;
  importer.SetPropertyInteger(AI_CONFIG_PP_SBP_REMOVE, aiPrimitiveType_POINT | aiPrimitiveType_LINE);
  const aiScene* scene =
      importer.ReadFileFromMemory(content->data(), content->size(),
                                  aiProcess_Triangulate | aiProcess_PreTransformVertices |
                                      aiProcess_SortByPType | aiProcess_ValidateDataStructure,
                                  "obj");
  if (scene == nullptr) {
    std::string reason = importer.GetErrorString();
    std::replace(reason.begin(), reason.end(), '\n', ' ');
    return Error{path, "is not a readable mesh: " + reason, "export it again"};
  }
  RawMesh raw;
  for (unsigned i = 0; i < scene->mNumMeshes; ++i) {
    const aiMesh& part = *scene->mMeshes[i];
    const auto first = static_cast<std::uint32_t>(raw.vertices.size());
    for (unsigned k = 0; k < part.mNumVertices; ++k)
      raw.vertices.emplace_back(part.mVertices[k].x, part.mVertices[k].y, part.mVertices[k].z);
    for (unsigned k = 0; k < part.mNumFaces; ++k) {
      const aiFace& face = part.mFaces[k];
      if (face.mNumIndices != 3) continue;
      raw.triangles.push_back({first + face.mIndices[0], first + face.mIndices[1], first + face.mIndices[2]});
      auto& uv = raw.uv.emplace_back();
      for (unsigned c = 0; c < 3 && part.HasTextureCoords(0); ++c)
        uv[c] = {part.mTextureCoords[0][face.mIndices[c]].x, part.mTextureCoords[0][face.mIndices[c]].y};
    }
  }
  return raw;
}

// Corner normals: the mean of the triangles at the corner that are within the smoothing angle.
void smooth_normals(Mesh& mesh) {
  const double cosine = std::cos(kSmoothingAngle);
  std::map<std::array<float, 3>, std::vector<std::size_t>> at_corner;
  std::vector<Eigen::Vector3d> flat;
  const auto place = [&](std::size_t triangle, std::size_t k) {
    const Eigen::Vector3f& v = mesh.vertices[mesh.triangles[triangle][k]];
    return std::array<float, 3>{v.x(), v.y(), v.z()};
  };
  for (std::size_t i = 0; i < mesh.triangles.size(); ++i) {
    flat.push_back(triangle_normal(mesh, i));
    for (std::size_t k = 0; k < 3; ++k) at_corner[place(i, k)].push_back(i);
  }
  for (std::size_t i = 0; i < mesh.triangles.size(); ++i) {
    auto& normals = mesh.normals.emplace_back();
    for (std::size_t k = 0; k < 3; ++k) {
      Eigen::Vector3d sum = Eigen::Vector3d::Zero();
      for (const std::size_t other : at_corner.at(place(i, k)))
        if (flat[other].dot(flat[i]) > cosine) sum += flat[other];
      normals[k] = sum.normalized().cast<float>();
    }
  }
}

Mesh covered(const RawMesh& raw, const MeshFileOptions& options) {
  Mesh mesh;
  for (const Eigen::Vector3d& v : raw.vertices)
    mesh.vertices.push_back(
        (options.scale * (options.y_up ? Eigen::Vector3d(v.x(), -v.z(), v.y()) : v)).cast<float>());
  const bool own_uv = raw.uv.size() == raw.triangles.size() && options.uv_m.prod() > 0;
  for (std::size_t i = 0; i < raw.triangles.size(); ++i) {
    mesh.triangles.push_back(raw.triangles[i]);
    const Eigen::Vector3d normal = triangle_normal(mesh, mesh.triangles.size() - 1);
    if (!(normal.norm() > 0.5)) {  // no area
      mesh.triangles.pop_back();
      continue;
    }
    auto& uv = mesh.uv.emplace_back();
    for (std::size_t k = 0; k < 3; ++k) {
      const Eigen::Vector3d corner = mesh.vertices[raw.triangles[i][k]].cast<double>();
      uv[k] = options.finish.uv.cast<float>() +
              (own_uv ? Eigen::Vector2f(raw.uv[i][k].cwiseProduct(options.uv_m).cast<float>())
                      : along_axes(corner, normal));
    }
    mesh.material.push_back(options.finish.material);
    mesh.object.push_back(options.finish.object);
  }
  smooth_normals(mesh);
  return mesh;
}

}  // namespace

Expected<Mesh> read_mesh(const std::string& path, const MeshFileOptions& options) {
  const std::string ending = extension(path);
  if (ending != "obj" && ending != "ply")
    return Error{path, "is neither .obj nor .ply", "convert the mesh to one of them"};
  const auto raw = ending == "ply" ? read_ply(path) : read_obj(path);
  if (!raw) return raw.error();
  if (raw->triangles.size() > kMostTriangles)
    return Error{path, text("has more than ", kMostTriangles, " triangles"), "simplify the mesh"};
  for (const Eigen::Vector3d& v : raw->vertices)
    if (!v.allFinite() || options.scale * v.norm() > kFarthest_m)
      return Error{path, "has a corner that is not finite or farther than 100 km from the origin",
                   "check the mesh and `scale`"};
  Mesh mesh = covered(*raw, options);
  if (mesh.triangles.empty()) return Error{path, "has no triangle", "export faces, not only points"};
  return mesh;
}

}  // namespace evpose::sim
