// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/sim/world/mesh_builder.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "evpose/core/error.h"

namespace evpose::sim {
namespace {

struct Corner {
  Eigen::Vector3d position, normal;
  Eigen::Vector2d uv;
};

std::uint32_t add_vertex(Mesh& mesh, const Eigen::Vector3d& position) {
  mesh.vertices.push_back(position.cast<float>());
  return static_cast<std::uint32_t>(mesh.vertices.size() - 1);
}

void add_triangle(Mesh& mesh, const Mesh::Corners& vertices, const std::array<const Corner*, 3>& corners,
                  const Finish& finish) {
  mesh.triangles.push_back(vertices);
  auto& uv = mesh.uv.emplace_back();
  auto& normals = mesh.normals.emplace_back();
  for (std::size_t i = 0; i < 3; ++i) {
    uv[i] = (finish.uv + corners[i]->uv).cast<float>();
    normals[i] = corners[i]->normal.cast<float>();
  }
  mesh.material.push_back(finish.material);
  mesh.object.push_back(finish.object);
}

// Corners round the face, seen from outside counterclockwise.
void add_quad(Mesh& mesh, const std::array<Corner, 4>& c, const Finish& finish) {
  Mesh::Corners first{}, second{};
  const std::uint32_t v0 = add_vertex(mesh, c[0].position), v1 = add_vertex(mesh, c[1].position);
  const std::uint32_t v2 = add_vertex(mesh, c[2].position), v3 = add_vertex(mesh, c[3].position);
  first = {v0, v1, v2};
  second = {v0, v2, v3};
  add_triangle(mesh, first, {&c[0], &c[1], &c[2]}, finish);
  add_triangle(mesh, second, {&c[0], &c[2], &c[3]}, finish);
}

// A face of its own lengths on the texture.
struct Frame {
  Eigen::Vector3d corner, along_u, along_v, normal;  // unit directions; along_v as the face has it
  double width, height;
  Eigen::Vector2d v_on_texture;  // unit; (0, 1) in a rectangle
  bool turned = false;           // the texture by a quarter

  explicit Frame(const Face& face, bool along_grain = false)
      : corner(face.corner),
        along_u(face.u.normalized()),
        along_v(face.v.normalized()),
        normal(face.u.cross(face.v).normalized()),
        width(face.u.norm()),
        height(face.v.norm()),
        v_on_texture(along_u.dot(along_v), along_u.cross(along_v).norm()),
        turned(along_grain && height > width) {}
  Corner at(double u, double v) const {
    const Eigen::Vector2d uv = Eigen::Vector2d(u, 0) + v * v_on_texture;
    return {corner + u * along_u + v * along_v, normal, turned ? Eigen::Vector2d(uv.y(), -uv.x()) : uv};
  }
};

std::vector<double> cuts(const std::vector<Opening>& openings, double end, double Opening::*low,
                         double Opening::*high) {
  std::vector<double> all = {0, end};
  for (const Opening& o : openings) {
    all.push_back(std::clamp(o.*low, 0.0, end));
    all.push_back(std::clamp(o.*high, 0.0, end));
  }
  std::sort(all.begin(), all.end());
  all.erase(std::unique(all.begin(), all.end(), [](double a, double b) { return b - a < 1e-6; }), all.end());
  all.back() = end;
  return all;
}

bool open_at(const std::vector<Opening>& openings, double u, double v) {
  return std::any_of(openings.begin(), openings.end(),
                     [&](const Opening& o) { return u > o.u0 && u < o.u1 && v > o.v0 && v < o.v1; });
}

// The faces into the depth of an opening, cut like the wall around it.
struct RevealCuts {
  const std::vector<double>&us, &vs;
};
void add_reveal(Mesh& mesh, const Frame& frame, const Opening& o, double depth, const RevealCuts& cut,
                const Finish& finish) {
  const Eigen::Vector3d inwards = -depth * frame.normal;
  const auto strip = [&](const Eigen::Vector2d& from, const Eigen::Vector2d& to) {
    const Eigen::Vector3d a = frame.at(from.x(), from.y()).position, b = frame.at(to.x(), to.y()).position;
    Finish own = finish;
    own.uv += Eigen::Vector2d(from.x() + from.y(), 0);
    add_face(mesh, {a, b - a, inwards}, own);
  };
  for (std::size_t i = 0; i + 1 < cut.us.size(); ++i) {
    const double from = cut.us[i], to = cut.us[i + 1];
    if (0.5 * (from + to) < o.u0 || 0.5 * (from + to) > o.u1) continue;
    strip({from, o.v0}, {to, o.v0});
    strip({to, o.v1}, {from, o.v1});
  }
  for (std::size_t j = 0; j + 1 < cut.vs.size(); ++j) {
    const double from = cut.vs[j], to = cut.vs[j + 1];
    if (0.5 * (from + to) < o.v0 || 0.5 * (from + to) > o.v1) continue;
    strip({o.u1, from}, {o.u1, to});
    strip({o.u0, to}, {o.u0, from});
  }
}

}  // namespace

void add_face(Mesh& mesh, const Face& face, const Finish& finish) {
  const Frame f(face, finish.along_grain);
  add_quad(mesh, {f.at(0, 0), f.at(f.width, 0), f.at(f.width, f.height), f.at(0, f.height)}, finish);
}

void add_box(Mesh& mesh, const Pose& T_part_box, const Eigen::Vector3d& size, const Finish& finish,
             unsigned sides) {
  const Eigen::Vector3d h = 0.5 * size, x(size.x(), 0, 0), y(0, size.y(), 0), z(0, 0, size.z());
  const std::array<Face, 6> faces = {
      Face{{-h.x(), h.y(), -h.z()}, -y, z}, Face{{h.x(), -h.y(), -h.z()}, y, z},
      Face{{-h.x(), -h.y(), -h.z()}, x, z}, Face{{h.x(), h.y(), -h.z()}, -x, z},
      Face{{-h.x(), h.y(), -h.z()}, x, -y}, Face{{-h.x(), -h.y(), h.z()}, x, y}};
  for (unsigned i = 0; i < 6; ++i) {
    if ((sides & (1u << i)) == 0) continue;
    Finish own = finish;
    own.uv += Eigen::Vector2d(0.731 * i, 0.377 * i);
    add_face(mesh, {T_part_box * faces[i].corner, T_part_box.q * faces[i].u, T_part_box.q * faces[i].v}, own);
  }
}

void add_box_on(Mesh& mesh, const Eigen::Vector3d& foot, const Eigen::Vector3d& size, double yaw,
                const Finish& finish, unsigned sides) {
  add_box(mesh, {so3::exp(yaw * Eigen::Vector3d::UnitZ()), foot + Eigen::Vector3d(0, 0, 0.5 * size.z())},
          size, finish, sides);
}

void add_box_between(Mesh& mesh, const Eigen::Vector3d& low, const Eigen::Vector3d& high,
                     const Finish& finish, unsigned sides) {
  add_box(mesh, {Eigen::Quaterniond::Identity(), 0.5 * (low + high)}, high - low, finish, sides);
}

void add_cylinder(Mesh& mesh, const Pose& T_part_axis, const Cylinder& c, const Finish& finish) {
  const double slope = (c.radius_below - c.radius_above) / c.height;
  const double slant = c.height * std::hypot(1.0, slope);
  const auto corner = [&](int i, bool above) {
    const double angle = 2 * std::numbers::pi * i / c.facets;
    // The last corner is the first one: the same to the last bit.
    const double closed = 2 * std::numbers::pi * (i % c.facets) / c.facets;
    const Eigen::Vector3d out(std::cos(closed), std::sin(closed), 0);
    const double radius = above ? c.radius_above : c.radius_below;
    const Eigen::Vector3d normal = (out + slope * Eigen::Vector3d::UnitZ()).normalized();
    return Corner{T_part_axis * Eigen::Vector3d(radius * out + Eigen::Vector3d(0, 0, above ? c.height : 0)),
                  T_part_axis.q * normal,
                  {angle * std::max(c.radius_below, c.radius_above), above ? slant : 0}};
  };
  const auto lid = [&](bool above) {
    const double sign = above ? 1 : -1, radius = above ? c.radius_above : c.radius_below;
    const Eigen::Vector3d normal = T_part_axis.q * Eigen::Vector3d(0, 0, sign);
    const auto place = [&](int i) {
      Corner on_rim = corner(i, above);
      const double angle = 2 * std::numbers::pi * i / c.facets;
      on_rim.normal = normal;
      on_rim.uv = radius * Eigen::Vector2d(std::cos(angle), sign * std::sin(angle));
      return on_rim;
    };
    const Corner middle{T_part_axis * Eigen::Vector3d(0, 0, above ? c.height : 0), normal, {0, 0}};
    const std::uint32_t centre = add_vertex(mesh, middle.position);
    for (int i = 0; i < c.facets; ++i) {
      const Corner from = place(above ? i : i + 1), to = place(above ? i + 1 : i);
      const std::uint32_t a = add_vertex(mesh, from.position), b = add_vertex(mesh, to.position);
      add_triangle(mesh, {centre, a, b}, {&middle, &from, &to}, finish);
    }
  };
  for (int i = 0; i < c.facets; ++i) {
    if (c.radius_above > 0 && c.radius_below > 0) {
      add_quad(mesh, {corner(i, false), corner(i + 1, false), corner(i + 1, true), corner(i, true)}, finish);
      continue;
    }
    const bool tip_above = c.radius_above <= 0;  // a cone's tip: one triangle
    const Corner a = corner(i, !tip_above), b = corner(i + 1, !tip_above), tip = corner(i, tip_above);
    const std::uint32_t va = add_vertex(mesh, a.position), vb = add_vertex(mesh, b.position);
    const std::uint32_t vt = add_vertex(mesh, tip.position);
    if (tip_above)
      add_triangle(mesh, {va, vb, vt}, {&a, &b, &tip}, finish);
    else
      add_triangle(mesh, {vb, va, vt}, {&b, &a, &tip}, finish);
  }
  if (c.lid_below && c.radius_below > 0) lid(false);
  if (c.lid_above && c.radius_above > 0) lid(true);
}

void add_ring(Mesh& mesh, const Pose& T_part_ring, const Ring& ring, const Finish& finish) {
  const auto corner = [&](int i, double radius) {
    const double angle = 2 * std::numbers::pi * (i % ring.facets) / ring.facets;
    const Eigen::Vector3d p(radius * std::cos(angle), radius * std::sin(angle), 0);
    return Corner{T_part_ring * p, T_part_ring.q * Eigen::Vector3d::UnitZ(), p.head<2>()};
  };
  for (int i = 0; i < ring.facets; ++i)
    add_quad(
        mesh,
        {corner(i, ring.inner), corner(i, ring.outer), corner(i + 1, ring.outer), corner(i + 1, ring.inner)},
        finish);
}

void add_wall(Mesh& mesh, const Face& face, const std::vector<Opening>& openings, double reveal_m,
              const Finish& finish, const Finish& reveal) {
  const Frame frame(face);
  const std::vector<double> us = cuts(openings, frame.width, &Opening::u0, &Opening::u1);
  const std::vector<double> vs = cuts(openings, frame.height, &Opening::v0, &Opening::v1);
  for (std::size_t i = 0; i + 1 < us.size(); ++i) {
    for (std::size_t j = 0; j + 1 < vs.size(); ++j) {
      if (open_at(openings, 0.5 * (us[i] + us[i + 1]), 0.5 * (vs[j] + vs[j + 1]))) continue;
      add_quad(mesh,
               {frame.at(us[i], vs[j]), frame.at(us[i + 1], vs[j]), frame.at(us[i + 1], vs[j + 1]),
                frame.at(us[i], vs[j + 1])},
               finish);
    }
  }
  if (reveal_m <= 0) return;
  for (const Opening& o : openings) add_reveal(mesh, frame, o, reveal_m, {us, vs}, reveal);
}

void add_print(Mesh& mesh, const Face& face, const Opening& at, const Finish& finish) {
  const Frame frame(face);
  const Eigen::Vector3d lift = kPrintLift * frame.normal;
  add_face(mesh,
           {frame.at(at.u0, at.v0).position + lift, (at.u1 - at.u0) * frame.along_u,
            (at.v1 - at.v0) * frame.along_v},
           finish);
}

void add_mesh(Mesh& mesh, const Mesh& other, const Pose& T_mesh_other) {
  const auto first = static_cast<std::uint32_t>(mesh.vertices.size());
  for (const Eigen::Vector3f& v : other.vertices)
    mesh.vertices.push_back((T_mesh_other * v.cast<double>()).cast<float>());
  for (const Mesh::Corners& t : other.triangles)
    mesh.triangles.push_back({first + t[0], first + t[1], first + t[2]});
  const Eigen::Quaternionf turn = T_mesh_other.q.cast<float>();
  for (const auto& normals : other.normals)
    mesh.normals.push_back({turn * normals[0], turn * normals[1], turn * normals[2]});
  mesh.uv.insert(mesh.uv.end(), other.uv.begin(), other.uv.end());
  mesh.material.insert(mesh.material.end(), other.material.begin(), other.material.end());
  mesh.object.insert(mesh.object.end(), other.object.begin(), other.object.end());
}

Eigen::Vector3d triangle_normal(const Mesh& mesh, std::size_t triangle) {
  const Mesh::Corners& t = mesh.triangles[triangle];
  const Eigen::Vector3d a = mesh.vertices[t[0]].cast<double>(), b = mesh.vertices[t[1]].cast<double>(),
                        c = mesh.vertices[t[2]].cast<double>();
  return (b - a).cross(c - a).normalized();
}

}  // namespace evpose::sim
