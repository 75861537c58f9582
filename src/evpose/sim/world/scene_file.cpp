// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/sim/world/scene_file.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>
#include <memory>
#include <numbers>
#include <utility>

#include "evpose/core/config.h"
#include "evpose/core/parallel.h"
#include "evpose/sim/world/closed_path.h"
#include "evpose/sim/world/mesh_file.h"
#include "evpose/sim/world/printed_things.h"
#include "evpose/sim/world/scene_fields.h"
#include "evpose/sim/world/world_builder.h"

namespace evpose::sim {
namespace {

constexpr double kLongest_m = 1000;
constexpr double kTurn = 2 * std::numbers::pi;
constexpr double kMostTexels = 5e7;  // 130 MB with its mipmap

class SceneReader {
 public:
  SceneReader(const YamlDocument& document, const WorldConfig& world)
      : document_(document), world_(world), builder_(world_) {}

  Expected<Scene> read(ThreadPool& pool) {
    SceneFields top(document_, document_.root, "scene");
    const YamlNode* const base = top.member("base");
    if (base != nullptr) {
      if (auto status = read_base(*base); !status) return status.error();
    }
    builder_.scene.name = top.string("name", base != nullptr ? builder_.scene.name : "scene");
    builder_.scene.sky_cd_m2 = top.number("sky_cd_m2", builder_.scene.sky_cd_m2, {0, 1e6});
    const double contrast = top.number("texture_contrast", world_.texture_contrast, {0, 3});
    const YamlNode* const space = top.member("free_space");
    using Reader = Status (SceneReader::*)(const YamlNode&);
    // Materials name lights, objects name materials.
    const std::pair<const char*, Reader> parts[] = {{"lights", &SceneReader::read_light},
                                                    {"materials", &SceneReader::read_material},
                                                    {"objects", &SceneReader::read_object},
                                                    {"moving", &SceneReader::read_moving},
                                                    {"panes", &SceneReader::read_pane}};
    for (const auto& [key, reader] : parts) {
      const YamlNode* const list = top.member(key);
      if (list == nullptr) continue;
      if (list->kind != YamlNode::Kind::list)
        return document_.error(*list, text(key, ": a list is expected"), "begin each item with '-'");
      for (const YamlNode& item : list->items)
        if (auto status = (this->*reader)(item); !status) return status.error();
    }
    if (auto status = top.finish(); !status) return status.error();
    if (auto status = read_space(space, base != nullptr); !status) return status.error();
    if (builder_.scene.mesh.triangles.empty())
      return document_.error(document_.root, "the scene has no static object", "add `base` or `objects`");
    if (builder_.scene.lights.empty())
      return document_.error(document_.root, "the scene has no light", "add `lights`");
    builder_.scene.materials = builder_.materials.build(contrast, pool);
    return std::move(builder_.scene);
  }

 private:
  Status read_base(const YamlNode& node) {
    ConfigTable table;
    describe(table, world_);
    if (auto status = set_all(table, node, ""); !status) return status;
    return build_world(builder_);
  }
  Status set_all(ConfigTable& table, const YamlNode& node, const std::string& prefix) const {
    if (node.kind != YamlNode::Kind::map)
      return document_.error(node, "base: keys and values are expected", "write {kind: hall, ...}");
    for (const YamlNode::Member& m : node.members) {
      const std::string where = text(document_.path, ":", m.value.line);
      auto status = m.value.kind == YamlNode::Kind::map ? set_all(table, m.value, prefix + m.key + ".")
                                                        : table.set(prefix + m.key, m.value.scalar, where);
      if (!status) return status;
    }
    return {};
  }

  Status read_space(const YamlNode* node, bool has_base) {
    Scene& scene = builder_.scene;
    if (node != nullptr) {
      SceneFields fields(document_, *node, "free_space");
      scene.low = fields.needed_vector("low");
      scene.high = fields.needed_vector("high");
      if (auto status = fields.finish(); !status) return status;
      if ((scene.high - scene.low).minCoeff() <= 0)
        return document_.error(*node, "free_space: low is not below high", "exchange them");
      return {};
    }
    if (has_base) return {};
    return document_.error(
        document_.root, "scene: 'free_space' is missing",
        "give the box in which the camera may fly: free_space: {low: [x, y, z], high: [x, y, z]}");
  }

  Status read_light(const YamlNode& node) {
    SceneFields f(document_, node, "light");
    Light light;
    light.name = f.string("name", "light");
    const std::string kind = f.needed_string("kind");
    if (kind == "lamp") {
      light.kind = LightKind::lamp;
      light.strength = f.needed_number("candela", {0, 1e7});
      light.position = f.needed_vector("at");
      light.radius = f.number("radius_m", 0.1, {0, 10});
    } else if (kind == "sun") {
      light.kind = LightKind::sun;
      light.strength = f.needed_number("lux", {0, 2e5});
      light.direction = f.needed_vector("direction");
      light.radius = f.number("radius_rad", 4.65e-3, {0, 0.5});
      light.daylight = true;
      if (light.direction.norm() < 1e-6)
        f.fail(node, "direction: has no length", "give the direction of its light, e.g. [0.3, 0.2, -1]");
      light.direction.normalize();
    } else if (kind == "ambient") {
      light.strength = f.needed_number("lux", {0, 2e5});
    } else {
      f.fail(node, "kind: '" + kind + "' is no kind of light", "take lamp, sun or ambient");
    }
    light.daylight = f.boolean("daylight", light.daylight);
    if (auto status = f.finish(); !status) return status;
    builder_.scene.lights.push_back(light);
    return {};
  }

  Status read_material(const YamlNode& node) {
    SceneFields f(document_, node, "material");
    const std::string name = f.needed_string("name"), pattern = f.string("pattern", "");
    const double glow = f.number("emission_cd_m2", 0, {0, 1e7});
    const std::string light = f.string("emission_light", "");
    std::int32_t material = 0;
    if (!pattern.empty()) {
      const double tone = f.number("tone", 1, {0, 1.6});
      const Eigen::Vector2d size = f.pair("size_m", {4, 4}, {0.05, 50});
      const double texel = f.number("texel_m", 0.004, {0.0005, 1});
      const double seed = f.number("seed", 1, {0, 1e9});
      if (size.prod() / (texel * texel) > kMostTexels)
        f.fail(node, "texel_m: the texture would have more than 50 million texels",
               "make it coarser or smaller");
      const Repeat repeat{size.x(), size.y()};
      Pattern made =
          f.failed() ? Pattern{} : named_pattern(pattern, repeat, static_cast<std::uint64_t>(seed));
      if (!f.failed() && !made)
        f.fail(node, "pattern: '" + pattern + "' is unknown",
               "did you mean '" + nearest_word(pattern, pattern_names()) + "'?");
      material = builder_.materials.add_textured(name, tone, repeat, texel, std::move(made));
    } else {
      material = builder_.materials.add_plain(name, f.number("reflectance", 0.5, {0, 1}));
    }
    builder_.materials.set_mirror(material, f.number("mirror", 0, {0, 1}));
    if (glow > 0) builder_.materials.set_emission(material, glow, light_number(f, node, light));
    if (materials_.count(name) != 0) f.fail(node, "material: '" + name + "' stands here twice", "rename one");
    materials_[name] = material;
    return f.finish();
  }
  int light_number(SceneFields& f, const YamlNode& node, const std::string& name) const {
    if (name.empty()) return -1;
    for (std::size_t i = 0; i < builder_.scene.lights.size(); ++i)
      if (builder_.scene.lights[i].name == name) return static_cast<int>(i);
    f.fail(node, "emission_light: there is no light '" + name + "'", "name one of `lights`");
    return -1;
  }

  // The material that a member names.
  std::int32_t material(SceneFields& f, const std::string& key) const {
    const std::string name = f.needed_string(key);
    const auto found = materials_.find(name);
    if (found != materials_.end()) return found->second;
    if (f.failed()) return 0;
    std::vector<std::string> names;
    for (const auto& known : materials_) names.push_back(known.first);
    const std::string nearest = nearest_word(name, names);
    f.fail(f.node(), key + ": '" + name + "' is unknown",
           nearest.empty() ? "list it under `materials`" : "did you mean '" + nearest + "'?");
    return 0;
  }
  Finish finish(SceneFields& f, std::int32_t object) const {
    Finish out{0, object, {0, 0}};
    const Eigen::Vector2d uv = f.pair("uv_m", {0, 0}, {-kLongest_m, kLongest_m});
    out.uv = uv;
    out.along_grain = f.boolean("along_grain", false);
    out.material = material(f, "material");
    return out;
  }

  // A body in its own frame, as one of its keys describes it. Bodies stand on z = 0.
  Expected<Mesh> read_body(SceneFields& f, const Finish& covering) const {
    Mesh mesh;
    const std::string kind =
        f.needed_one_of({"box", "cylinder", "quad", "mesh", "landing_pad", "checkerboard"});
    const YamlNode* const node = f.member(kind);
    if (node == nullptr) return f.finish().error();
    if (kind == "mesh") return read_mesh_file(*node, covering);
    SceneFields shape(document_, *node, kind);
    if (kind == "box") {
      const Eigen::Vector3d size = shape.needed_size("size", 0.001);
      const bool open = shape.boolean("open_below", false);
      if (!shape.failed())
        add_box_on(mesh, {0, 0, 0}, size, 0, covering,
                   open ? all_sides & ~static_cast<unsigned>(side_below) : all_sides);
    } else if (kind == "cylinder") {
      Cylinder c;
      c.radius_below = shape.needed_number("radius", {0.001, 100});
      c.radius_above = shape.number("radius_above", c.radius_below, {0, 100});
      c.height = shape.needed_number("height", {0.001, kLongest_m});
      c.facets = static_cast<int>(shape.number("facets", 40, {6, 1000}));
      if (!shape.failed()) add_cylinder(mesh, {}, c, covering);
    } else if (kind == "landing_pad" || kind == "checkerboard") {
      read_printed(shape, kind, covering, mesh);
    } else {
      const Face face{shape.vector("corner", {0, 0, 0}), shape.needed_vector("u"), shape.needed_vector("v")};
      if (face.u.cross(face.v).norm() < 1e-6)
        shape.fail(*node, "quad: u and v span no area", "give two directions");
      if (!shape.failed()) add_face(mesh, face, covering);
    }
    if (auto status = shape.finish(); !status) return status.error();
    return mesh;
  }
  void read_printed(SceneFields& shape, const std::string& kind, const Finish& covering, Mesh& mesh) const {
    Finish ink = covering;
    ink.material = material(shape, "ink");
    if (kind == "landing_pad") {
      LandingPad pad;
      pad.size = shape.number("size_m", pad.size, {0.05, 100});
      pad.height = shape.number("height_m", pad.height, {0, 100});
      const std::string mark = shape.string("mark", "h");
      const auto marks = pad_marks();
      const auto found =
          std::find_if(marks.begin(), marks.end(), [&](const auto& m) { return m.first == mark; });
      if (found == marks.end())
        shape.fail(shape.node(), "mark: '" + mark + "' is unknown", "take none, h, ring or squares");
      else
        pad.mark = found->second;
      if (!shape.failed()) add_landing_pad(mesh, {}, pad, covering, ink);
      return;
    }
    Checkerboard board;
    board.columns = static_cast<int>(shape.number("columns", board.columns, {2, 100}));
    board.rows = static_cast<int>(shape.number("rows", board.rows, {2, 100}));
    board.square_m = shape.number("square_m", board.square_m, {0.001, 10});
    board.margin_m = shape.number("margin_m", board.margin_m, {0, 10});
    board.middle_m = shape.number("middle_m", board.middle_m, {0.01, 100});
    if (board.middle_m < 0.5 * board.rows * board.square_m + board.margin_m)
      shape.fail(shape.node(), "middle_m: the board reaches below its foot", "raise it");
    if (!shape.failed()) add_checkerboard(mesh, {}, board, covering, ink);
  }
  Expected<Mesh> read_mesh_file(const YamlNode& node, const Finish& covering) const {
    SceneFields f(document_, node, "mesh");
    MeshFileOptions options;
    const std::string file = f.needed_string("file");
    options.scale = f.number("scale", 1, {1e-6, 1e6});
    options.uv_m = f.pair("texture_size_m", {0, 0}, {0, 1000});
    const std::string up = f.string("up", "z");
    if (up != "y" && up != "z") f.fail(node, "up: '" + up + "' is no such axis", "take y or z");
    options.y_up = up == "y";
    options.finish = covering;
    if (auto status = f.finish(); !status) return status.error();
    // Relative to the file of the scene.
    return read_mesh((std::filesystem::path(document_.path).parent_path() / file).string(), options);
  }

  Status read_object(const YamlNode& node) {
    SceneFields f(document_, node, "object");
    const std::int32_t object = builder_.add_object(f.string("name", "object"));
    if (f.boolean("furniture", false)) builder_.scene.furniture.push_back(object);
    const Pose T_map_body = f.pose();
    const auto body = read_body(f, finish(f, object));
    if (auto status = f.finish(); !status) return status;
    if (!body) return body.error();
    add_mesh(builder_.scene.mesh, *body, T_map_body);
    return {};
  }

  Status read_pane(const YamlNode& node) {
    SceneFields f(document_, node, "pane");
    const Pane pane{f.needed_vector("corner"), f.needed_vector("u"), f.needed_vector("v")};
    const double area = pane.u.norm() * pane.v.norm();
    if (area < 1e-6 || std::abs(pane.u.dot(pane.v)) > 1e-3 * area)
      f.fail(node, "pane: u and v are not the sides of a rectangle", "give two directions at right angles");
    if (auto status = f.finish(); !status) return status;
    builder_.scene.panes.push_back(pane);
    return {};
  }

  const MoverMaterials& mover_materials() {
    if (!movers_) movers_ = add_mover_materials(builder_.materials, builder_.seed(), 0.004);
    return *movers_;
  }

  Status read_moving(const YamlNode& node) {
    SceneFields f(document_, node, "moving");
    const std::string kind = f.string("kind", "thing"), name = f.string("name", kind);
    Status status;
    if (kind == "fan") {
      Fan fan;
      fan.name = name;
      fan.T_map_fan = f.pose();
      fan.radius_m = f.number("radius_m", fan.radius_m, {0.02, 20});
      fan.blades = static_cast<int>(f.number("blades", fan.blades, {1, 24}));
      fan.rpm = f.number("rpm", fan.rpm, {-60000, 60000});
      fan.stand_to_z = f.number("stand_to_z", fan.stand_to_z, {-1e9, 1e5});
      status = f.finish();
      if (status) add_fan(builder_.scene, mover_materials(), fan);
    } else if (kind == "person") {
      Walker person;
      person.name = name;
      person.path = f.points("path", 3);
      person.speed_m_s = f.number("speed_m_s", person.speed_m_s, {-5, 5});
      person.start_m = f.number("start_m", 0, {-1e6, 1e6});
      person.height_m = f.number("height_m", person.height_m, {0.3, 3});
      person.clothes = static_cast<int>(f.number("look", 0, {0, 1000}));
      status = f.finish();
      if (status) add_walker(builder_.scene, mover_materials(), person);
    } else if (kind == "car") {
      Car car;
      car.name = name;
      car.path = f.points("path", 3);
      car.speed_m_s = f.number("speed_m_s", car.speed_m_s, {-60, 60});
      car.start_m = f.number("start_m", 0, {-1e6, 1e6});
      car.paint = static_cast<int>(f.number("look", 0, {0, 1000}));
      status = f.finish();
      if (status) add_car(builder_.scene, mover_materials(), car);
    } else if (kind == "thing") {
      status = read_moving_thing(f, name);
    } else {
      f.fail(node, "kind: '" + kind + "' is unknown", "take fan, person, car or thing");
      status = f.finish();
    }
    return status;
  }

  // A custom body that moves along a path, rotates about an axis, or both.
  Status read_moving_thing(SceneFields& f, const std::string& name) {
    const std::int32_t object = builder_.add_object(name);
    const Pose T_way_body = f.pose();
    const Eigen::Vector3d axis = f.vector("spin_axis", {0, 0, 1});
    const double rate = f.number("spin_rpm", 0, {-60000, 60000}) / 60 * kTurn;
    const double speed = f.number("speed_m_s", 1, {-200, 200}), start = f.number("start_m", 0, {-1e6, 1e6});
    const bool follow = f.boolean("turns_with_path", true);
    std::shared_ptr<const ClosedPath> path;
    if (f.member("path") != nullptr) {
      const std::vector<Eigen::Vector3d> points = f.points("path", 3);
      if (!f.failed()) path = std::make_shared<const ClosedPath>(points);
    }
    if (axis.norm() < 1e-6) f.fail(f.node(), "spin_axis: has no length", "give a direction");
    auto body = read_body(f, finish(f, object));
    if (auto status = f.finish(); !status) return status;
    if (!body) return body.error();
    const Eigen::Vector3d spin = rate * axis.normalized();
    builder_.scene.moving.push_back(
        {name, *std::move(body), [=](double t_s) {
           Pose T_map_way;
           if (path) {
             const ClosedPath::At at = path->at(start + speed * t_s);
             T_map_way.p = at.position;
             if (follow) T_map_way.q = so3::exp({0, 0, std::atan2(at.tangent.y(), at.tangent.x())});
           }
           return T_map_way * T_way_body * Pose{so3::exp(spin * t_s), Eigen::Vector3d::Zero()};
         }});
    return {};
  }

  const YamlDocument& document_;
  WorldConfig world_;
  WorldBuilder builder_;
  std::map<std::string, std::int32_t> materials_;
  std::optional<MoverMaterials> movers_;
};

}  // namespace

Expected<Scene> read_scene(const std::string& path, const WorldConfig& world, ThreadPool& pool) {
  const auto document = YamlDocument::read(path);
  if (!document) return document.error();
  return SceneReader(*document, world).read(pool);
}

}  // namespace evpose::sim
