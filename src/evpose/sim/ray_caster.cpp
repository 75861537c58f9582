// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/sim/ray_caster.h"

#include <embree3/rtcore.h>

#include <cstring>
#include <vector>

#include "evpose/core/error.h"

namespace evpose::sim {
namespace {

struct Release {
  void operator()(RTCScene scene) const { rtcReleaseScene(scene); }
};
using ScenePointer = std::unique_ptr<RTCSceneTy, Release>;

void fault(void*, RTCError, const char* message) { throw std::runtime_error(text("ray casting: ", message)); }

ScenePointer make_scene(RTCDevice device, const Mesh& mesh) {
  ScenePointer scene(rtcNewScene(device));
  // Watertight: a ray through the seam of two triangles must not slip between them.
  rtcSetSceneFlags(scene.get(), RTC_SCENE_FLAG_ROBUST);
  rtcSetSceneBuildQuality(scene.get(), RTC_BUILD_QUALITY_HIGH);
  if (!mesh.triangles.empty()) {
    RTCGeometry geometry = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE);
    void* vertices = rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3,
                                             sizeof(Eigen::Vector3f), mesh.vertices.size());
    std::memcpy(vertices, mesh.vertices.data(), mesh.vertices.size() * sizeof(Eigen::Vector3f));
    void* triangles = rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3,
                                              sizeof(Mesh::Corners), mesh.triangles.size());
    std::memcpy(triangles, mesh.triangles.data(), mesh.triangles.size() * sizeof(Mesh::Corners));
    rtcCommitGeometry(geometry);
    rtcAttachGeometry(scene.get(), geometry);
    rtcReleaseGeometry(geometry);
  }
  rtcCommitScene(scene.get());
  return scene;
}

RTCRay make_ray(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction, float near, float far) {
  RTCRay ray{};
  ray.org_x = static_cast<float>(origin.x());
  ray.org_y = static_cast<float>(origin.y());
  ray.org_z = static_cast<float>(origin.z());
  ray.dir_x = static_cast<float>(direction.x());
  ray.dir_y = static_cast<float>(direction.y());
  ray.dir_z = static_cast<float>(direction.z());
  ray.tnear = near;
  ray.tfar = far;
  ray.mask = ~0u;
  return ray;
}

std::optional<RayHit> nearest(RTCScene scene, int part, const Eigen::Vector3d& origin,
                              const Eigen::Vector3d& direction, float near, float far) {
  RTCRayHit query{};
  query.ray = make_ray(origin, direction, near, far);
  query.hit.geomID = RTC_INVALID_GEOMETRY_ID;
  query.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  rtcIntersect1(scene, &context, &query);
  if (query.hit.geomID == RTC_INVALID_GEOMETRY_ID) return std::nullopt;
  return RayHit{query.ray.tfar, part, query.hit.primID};
}

}  // namespace

struct RayCaster::Impl {
  struct ReleaseDevice {
    void operator()(RTCDevice device) const { rtcReleaseDevice(device); }
  };
  std::unique_ptr<RTCDeviceTy, ReleaseDevice> device;
  ScenePointer still;
  std::vector<ScenePointer> moving;
};

RayCaster::RayCaster(const Scene& scene) : scene_(scene), impl_(std::make_unique<Impl>()) {
  impl_->device.reset(rtcNewDevice("threads=1"));
  EVPOSE_CHECK(impl_->device);
  rtcSetDeviceErrorFunction(impl_->device.get(), fault, nullptr);
  impl_->still = make_scene(impl_->device.get(), scene.mesh);
  for (const MovingPart& part : scene.moving)
    impl_->moving.push_back(make_scene(impl_->device.get(), part.mesh));
}

RayCaster::~RayCaster() = default;

std::optional<RayHit> RayCaster::trace(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction,
                                       float near, float far) const {
  return nearest(impl_->still.get(), -1, origin, direction, near, far);
}

std::optional<RayHit> RayCaster::trace_part(int part, const Eigen::Vector3d& origin,
                                            const Eigen::Vector3d& direction, float near, float far) const {
  return nearest(impl_->moving[part].get(), part, origin, direction, near, far);
}

std::optional<RayHit> RayCaster::trace_at(double t_s, const Eigen::Vector3d& origin,
                                          const Eigen::Vector3d& direction, float near, float far) const {
  std::optional<RayHit> hit = trace(origin, direction, near, far);
  for (std::size_t i = 0; i < scene_.moving.size(); ++i) {
    const Pose T_part_map = scene_.moving[i].T_map_part(t_s).inverse();
    const auto closer = trace_part(static_cast<int>(i), T_part_map * origin, T_part_map.q * direction, near,
                                   hit ? hit->distance : far);
    if (closer) hit = closer;
  }
  return hit;
}

bool RayCaster::blocked(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction, float near,
                        float far) const {
  RTCRay ray = make_ray(origin, direction, near, far);
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  rtcOccluded1(impl_->still.get(), &context, &ray);
  return ray.tfar < 0;
}

}  // namespace evpose::sim
