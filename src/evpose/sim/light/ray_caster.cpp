// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/sim/light/ray_caster.h"

#include <embree3/rtcore.h>

#include <algorithm>
#include <array>
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
    auto* vertices = static_cast<Eigen::Vector3f*>(
        rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3,
                                sizeof(Eigen::Vector3f), mesh.vertices.size()));
    std::copy(mesh.vertices.begin(), mesh.vertices.end(), vertices);
    auto* triangles = static_cast<Mesh::Corners*>(rtcSetNewGeometryBuffer(
        geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, sizeof(Mesh::Corners), mesh.triangles.size()));
    std::copy(mesh.triangles.begin(), mesh.triangles.end(), triangles);
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

// Eight rays at a time.
void nearest_of_each(RTCScene scene, const Eigen::Vector3d& origin,
                     std::span<const Eigen::Vector3f> directions, std::span<RayCaster::BatchHit> hits) {
  constexpr std::size_t kWide = 8;
  const Eigen::Vector3f from = origin.cast<float>();
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  context.flags = RTC_INTERSECT_CONTEXT_FLAG_COHERENT;
  for (std::size_t first = 0; first < directions.size(); first += kWide) {
    const std::size_t n = std::min(kWide, directions.size() - first);
    RTCRayHit8 query{};
    alignas(32) std::array<int, kWide> valid{};
    for (std::size_t i = 0; i < n; ++i) {
      valid[i] = -1;
      query.ray.org_x[i] = from.x();
      query.ray.org_y[i] = from.y();
      query.ray.org_z[i] = from.z();
      query.ray.dir_x[i] = directions[first + i].x();
      query.ray.dir_y[i] = directions[first + i].y();
      query.ray.dir_z[i] = directions[first + i].z();
      query.ray.tfar[i] = std::numeric_limits<float>::infinity();
      query.ray.mask[i] = ~0u;
      query.hit.geomID[i] = RTC_INVALID_GEOMETRY_ID;
      query.hit.instID[0][i] = RTC_INVALID_GEOMETRY_ID;
    }
    rtcIntersect8(valid.data(), scene, &context, &query);
    for (std::size_t i = 0; i < n; ++i) {
      const bool met = query.hit.geomID[i] != RTC_INVALID_GEOMETRY_ID;
      hits[first + i] = {query.ray.tfar[i], met ? query.hit.primID[i] : RayCaster::kNoTriangle};
    }
  }
}

}  // namespace

struct RayCaster::Impl {
  struct ReleaseDevice {
    void operator()(RTCDevice one) const { rtcReleaseDevice(one); }
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

std::vector<Pose> RayCaster::parts_at(double t_s) const {
  std::vector<Pose> poses;
  for (const MovingPart& part : scene_.moving) poses.push_back(part.T_map_part(t_s));
  return poses;
}

std::optional<RayHit> RayCaster::trace(const std::vector<Pose>& T_map_part, const Eigen::Vector3d& origin,
                                       const Eigen::Vector3d& direction, float near, float far) const {
  std::optional<RayHit> hit = trace(origin, direction, near, far);
  for (std::size_t i = 0; i < T_map_part.size(); ++i) {
    const Pose T_part_map = T_map_part[i].inverse();
    const auto closer = nearest(impl_->moving[i].get(), static_cast<int>(i), T_part_map * origin,
                                T_part_map.q * direction, near, hit ? hit->distance : far);
    if (closer) hit = closer;
  }
  return hit;
}

void RayCaster::trace_batch(const Eigen::Vector3d& origin, std::span<const Eigen::Vector3f> directions,
                            std::span<BatchHit> hits) const {
  nearest_of_each(impl_->still.get(), origin, directions, hits);
}

void RayCaster::trace_part_batch(int part, const Eigen::Vector3d& origin,
                                 std::span<const Eigen::Vector3f> directions,
                                 std::span<BatchHit> hits) const {
  nearest_of_each(impl_->moving[part].get(), origin, directions, hits);
}

unsigned RayCaster::free_segments(const Eigen::Vector3d& origin, std::span<const Segment> segments) const {
  return free_segments(std::span(&origin, 1), segments);
}

unsigned RayCaster::free_segments(std::span<const Eigen::Vector3d> origins,
                                  std::span<const Segment> segments) const {
  EVPOSE_CHECK(segments.size() <= kMostSegments);
  EVPOSE_CHECK(origins.size() == 1 || origins.size() == segments.size());
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  RTCRay8 rays{};
  alignas(32) std::array<int, kMostSegments> valid{};
  for (std::size_t i = 0; i < segments.size(); ++i) {
    valid[i] = -1;
    const Eigen::Vector3f from = origins[origins.size() == 1 ? 0 : i].cast<float>();
    rays.org_x[i] = from.x();
    rays.org_y[i] = from.y();
    rays.org_z[i] = from.z();
    rays.dir_x[i] = segments[i].direction.x();
    rays.dir_y[i] = segments[i].direction.y();
    rays.dir_z[i] = segments[i].direction.z();
    rays.tnear[i] = segments[i].near;
    rays.tfar[i] = segments[i].far;
    rays.mask[i] = ~0u;
  }
  rtcOccluded8(valid.data(), impl_->still.get(), &context, &rays);
  unsigned free = 0;
  for (std::size_t i = 0; i < segments.size(); ++i) free |= (rays.tfar[i] < 0 ? 0U : 1U) << i;
  return free;
}

bool RayCaster::occluded(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction, float near,
                         float far) const {
  RTCRay ray = make_ray(origin, direction, near, far);
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  rtcOccluded1(impl_->still.get(), &context, &ray);
  return ray.tfar < 0;
}

}  // namespace evpose::sim
