// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/io/files/config_yaml.h"

#include "evpose/io/files/yaml_document.h"

namespace evpose {
namespace {

Status apply(ConfigTable& table, const YamlDocument& document, const YamlNode& node, const std::string& key) {
  if (node.kind == YamlNode::Kind::map) {
    for (const auto& [name, member] : node.members) {
      if (auto status = apply(table, document, member, key.empty() ? name : key + "." + name); !status)
        return status;
    }
    return {};
  }
  if (node.kind == YamlNode::Kind::list) return document.error(node, key + ": a list", "give one value");
  return table.set(key, node.scalar, text(document.path, ":", node.line));
}

}  // namespace

Status apply_yaml(ConfigTable& table, const std::string& path) {
  const auto document = YamlDocument::read(path);
  if (!document) return document.error();
  if (document->root.kind == YamlNode::Kind::null) return {};
  if (document->root.kind != YamlNode::Kind::map)
    return document->error(document->root, "no settings", "write `key: value` lines");
  return apply(table, *document, document->root, "");
}

Status apply_assignment(ConfigTable& table, const std::string& assignment) {
  const auto equals = assignment.find('=');
  if (equals == std::string::npos || equals == 0)
    return Error{"--set", "'" + assignment + "' is not key=value", "write --set key=value"};
  return table.set(assignment.substr(0, equals), assignment.substr(equals + 1), "--set");
}

Status apply_assignments(ConfigTable& table, const std::vector<std::string>& assignments) {
  for (const std::string& assignment : assignments)
    if (auto status = apply_assignment(table, assignment); !status) return status;
  return {};
}

Status apply_settings(ConfigTable& table, const std::string& path,
                      const std::vector<std::string>& assignments) {
  if (!path.empty())
    if (auto status = apply_yaml(table, path); !status) return status;
  return apply_assignments(table, assignments);
}

}  // namespace evpose
