// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/sim/mesh_file.h"

#include <assimp/config.h>
#include <assimp/postprocess.h>
#include <assimp/scene.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <assimp/Importer.hpp>
#include <cctype>

#include "evpose/io/atomic_file.h"

namespace evpose::sim {
namespace {

constexpr std::size_t kMostBytes = 256u << 20;
constexpr std::size_t kMostTriangles = 5'000'000;
constexpr double kFarthest_m = 1e5;  // beyond, floats are coarser than a centimetre
constexpr float kSmoothingAngle_deg = 40;

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

void add_triangles(const aiMesh& from, const MeshFileOptions& options, Mesh& mesh) {
  const auto turned = [&](const aiVector3D& v) {
    return options.y_up ? Eigen::Vector3d(v.x, -v.z, v.y) : Eigen::Vector3d(v.x, v.y, v.z);
  };
  const auto first = static_cast<std::uint32_t>(mesh.vertices.size());
  for (unsigned i = 0; i < from.mNumVertices; ++i)
    mesh.vertices.push_back((options.scale * turned(from.mVertices[i])).cast<float>());
  const bool has_uv = from.HasTextureCoords(0) && options.uv_m.prod() > 0;
  for (unsigned i = 0; i < from.mNumFaces; ++i) {
    const aiFace& face = from.mFaces[i];
    if (face.mNumIndices != 3) continue;
    mesh.triangles.push_back({first + face.mIndices[0], first + face.mIndices[1], first + face.mIndices[2]});
    const Eigen::Vector3d flat = triangle_normal(mesh, mesh.triangles.size() - 1);
    if (!(flat.norm() > 0.5)) {  // no area
      mesh.triangles.pop_back();
      continue;
    }
    auto& uv = mesh.uv.emplace_back();
    auto& normals = mesh.normals.emplace_back();
    for (unsigned k = 0; k < 3; ++k) {
      const unsigned corner = face.mIndices[k];
      const Eigen::Vector3d normal = from.HasNormals() ? turned(from.mNormals[corner]).normalized() : flat;
      normals[k] = (normal.dot(flat) > 0.1 ? normal : flat).cast<float>();
      uv[k] = options.finish.uv.cast<float>();
      if (has_uv) {
        const aiVector3D& at = from.mTextureCoords[0][corner];
        uv[k] += Eigen::Vector2f(at.x, at.y).cwiseProduct(options.uv_m.cast<float>());
      } else {
        uv[k] += along_axes(mesh.vertices[first + corner].cast<double>(), flat);
      }
    }
    mesh.material.push_back(options.finish.material);
    mesh.object.push_back(options.finish.object);
  }
}

}  // namespace

Expected<Mesh> read_mesh(const std::string& path, const MeshFileOptions& options) {
  const std::string ending = extension(path);
  if (ending != "obj" && ending != "ply")
    return Error{path, "is neither .obj nor .ply", "convert the mesh to one of them"};
  const auto content = read_text_file(path, kMostBytes);
  if (!content) return content.error();
  Assimp::Importer importer;
  importer.SetPropertyFloat(AI_CONFIG_PP_GSN_MAX_SMOOTHING_ANGLE, kSmoothingAngle_deg);
  importer.SetPropertyInteger(AI_CONFIG_PP_SBP_REMOVE, aiPrimitiveType_POINT | aiPrimitiveType_LINE);
  const aiScene* scene = importer.ReadFileFromMemory(
      content->data(), content->size(),
      aiProcess_Triangulate | aiProcess_PreTransformVertices | aiProcess_GenSmoothNormals |
          aiProcess_JoinIdenticalVertices | aiProcess_SortByPType | aiProcess_ValidateDataStructure,
      ending.c_str());
  if (scene == nullptr) {
    std::string reason = importer.GetErrorString();
    std::replace(reason.begin(), reason.end(), '\n', ' ');
    return Error{path, "is not a readable mesh: " + reason, "export it again"};
  }
  Mesh mesh;
  for (unsigned i = 0; i < scene->mNumMeshes; ++i) {
    if (mesh.triangles.size() + scene->mMeshes[i]->mNumFaces > kMostTriangles)
      return Error{path, text("has more than ", kMostTriangles, " triangles"), "simplify the mesh"};
    add_triangles(*scene->mMeshes[i], options, mesh);
  }
  if (mesh.triangles.empty()) return Error{path, "has no triangle", "export faces, not only points"};
  for (const Eigen::Vector3f& v : mesh.vertices)
    if (!v.allFinite() || v.norm() > kFarthest_m)
      return Error{path, "has a corner that is not finite or farther than 100 km from the origin",
                   "check the mesh and `scale`"};
  return mesh;
}

}  // namespace evpose::sim
