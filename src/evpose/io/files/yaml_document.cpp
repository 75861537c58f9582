// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/io/files/yaml_document.h"

#include <yaml-cpp/yaml.h>

#include <Eigen/LU>
#include <cmath>

#include "evpose/io/files/atomic_file.h"
#include "evpose/io/files/numbers.h"

namespace evpose {
namespace {

constexpr int kMostNodes = 1'000'000;  // aliases can make a short file stand for any number

/// Plain data from yaml-cpp's nodes.
struct Converter {
  const std::string& path;
  int nodes = 0;

  Expected<YamlNode> convert(const YAML::Node& in) {
    YamlNode out;
    out.line = std::max(in.Mark().line, 0) + 1;
    if (++nodes > kMostNodes)
      return Error{text(path, ":", out.line), text("more than ", kMostNodes, " values"),
                   "is it the right file?"};
    if (in.IsScalar()) {
      out.kind = YamlNode::Kind::scalar;
      out.scalar = in.Scalar();
    } else if (in.IsSequence()) {
      out.kind = YamlNode::Kind::list;
      for (const auto& item : in) {
        auto value = convert(item);
        if (!value) return value.error();
        out.items.push_back(*std::move(value));
      }
    } else if (in.IsMap()) {
      out.kind = YamlNode::Kind::map;
      for (const auto& member : in) {
        const int line = std::max(member.first.Mark().line, 0) + 1;
        if (!member.first.IsScalar())
          return Error{text(path, ":", line), "a key that is not plain text", "use plain keys"};
        const std::string key = member.first.Scalar();
        if (out.find(key) != nullptr)
          return Error{text(path, ":", line), "'" + key + "' stands here twice", "remove one"};
        auto value = convert(member.second);
        if (!value) return value.error();
        value->line = line;  // where one looks for it
        out.members.push_back({key, *std::move(value)});
      }
    }
    return out;
  }
};

/// OpenCV's first line "%YAML:1.0" is no YAML: blanked, so that lines keep their numbers.
void blank_opencv_directive(std::string& content) {
  for (std::size_t at = content.find("%YAML:"); at != std::string::npos; at = content.find("%YAML:", at)) {
    const bool line_begins = at == 0 || content[at - 1] == '\n';
    for (; at < content.size() && content[at] != '\n'; ++at)
      if (line_begins) content[at] = ' ';
  }
}

void flatten(const YamlNode& node, std::vector<const YamlNode*>& out) {
  if (node.kind != YamlNode::Kind::list) {
    out.push_back(&node);
    return;
  }
  for (const YamlNode& item : node.items) flatten(item, out);
}

}  // namespace

const YamlNode* YamlNode::find(const std::string& key) const {
  for (const auto& [name, value] : members)
    if (name == key) return &value;
  return nullptr;
}

Expected<YamlDocument> YamlDocument::read(const std::string& path) {
  auto content = read_text_file(path, 16u << 20);
  if (!content) return content.error();
  blank_opencv_directive(*content);
  try {
    const YAML::Node root = YAML::Load(*content);
    auto node = Converter{path}.convert(root);
    if (!node) return node.error();
    return YamlDocument{path, *std::move(node)};
  } catch (const YAML::Exception& e) {
    const std::string where = e.mark.is_null() ? path : text(path, ":", e.mark.line + 1);
    return Error{where, "is not valid YAML: " + e.msg, "correct the file"};
  }
}

Error YamlDocument::error(const YamlNode& node, const std::string& what, const std::string& fix) const {
  return Error{text(path, ":", node.line), what, fix};
}

Expected<std::string> YamlDocument::string(const YamlNode& node, const std::string& key) const {
  if (node.kind != YamlNode::Kind::scalar) return error(node, key + ": text is expected", "give one value");
  return node.scalar;
}

Expected<double> YamlDocument::number(const YamlNode& node, const std::string& key) const {
  double value = 0;
  if (node.kind != YamlNode::Kind::scalar || !parse_number(node.scalar, value) || !std::isfinite(value))
    return error(node, key + ": '" + node.scalar + "' is not a finite number", "give a number");
  return value;
}

Expected<std::int64_t> YamlDocument::integer(const YamlNode& node, const std::string& key) const {
  std::int64_t value = 0;
  if (node.kind != YamlNode::Kind::scalar || !parse_integer(node.scalar, value))
    return error(node, key + ": '" + node.scalar + "' is not a whole number", "give a whole number");
  return value;
}

Expected<bool> YamlDocument::boolean(const YamlNode& node, const std::string& key) const {
  if (node.kind == YamlNode::Kind::scalar && (node.scalar == "true" || node.scalar == "false"))
    return node.scalar == "true";
  return error(node, key + ": '" + node.scalar + "' is neither true nor false", "write true or false");
}

Expected<std::vector<double>> YamlDocument::numbers(const YamlNode& node, const std::string& key,
                                                    std::size_t count) const {
  const YamlNode* data = node.find("data");
  const YamlNode& list = data != nullptr ? *data : node;
  if (list.kind != YamlNode::Kind::list)
    return error(node, key + ": a list is expected", "write [a, b, ...]");
  std::vector<const YamlNode*> leaves;
  flatten(list, leaves);
  if (count != 0 && leaves.size() != count)
    return error(node, text(key, ": ", leaves.size(), " numbers instead of ", count), "correct the list");
  std::vector<double> out;
  for (const YamlNode* leaf : leaves) {
    auto value = number(*leaf, key);
    if (!value) return value.error();
    out.push_back(*value);
  }
  return out;
}

Expected<Pose> YamlDocument::transform(const YamlNode& node, const std::string& key) const {
  auto values = numbers(node, key);
  if (!values) return values.error();
  if (values->size() == 12) values->insert(values->end(), {0, 0, 0, 1});
  if (values->size() != 16)
    return error(node, text(key, ": ", values->size(), " numbers instead of 16 or 12"),
                 "give a rigid transform, row by row");
  const Eigen::Matrix4d T = Eigen::Map<const Eigen::Matrix<double, 4, 4, Eigen::RowMajor>>(values->data());
  if ((T.row(3) - Eigen::RowVector4d(0, 0, 0, 1)).cwiseAbs().maxCoeff() > 1e-9)
    return error(node, key + ": the last row is not 0 0 0 1", "give a rigid transform, row by row");
  return rigid(node, key, T.topLeftCorner<3, 3>(), T.topRightCorner<3, 1>());
}

Expected<Pose> YamlDocument::rigid(const YamlNode& node, const std::string& key, const Eigen::Matrix3d& R,
                                   const Eigen::Vector3d& p) const {
  const double off = (R.transpose() * R - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff();
  if (!(off <= 1e-3) || R.determinant() < 0)
    return error(node,
                 text(key, ": its rotation is off an orthonormal matrix by ", off,
                      R.determinant() < 0 ? " and mirrors" : ""),
                 "give a rigid transform, row by row");
  return Pose{Eigen::Quaterniond(R).normalized(), p};
}

}  // namespace evpose
