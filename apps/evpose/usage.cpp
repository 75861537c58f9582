// SPDX-License-Identifier: BSD-3-Clause
#include "usage.h"

#include <CLI/CLI.hpp>
#include <algorithm>

#include "evpose/core/config.h"

namespace evpose {
namespace {

const CLI::App* subcommand(const CLI::App& app, const std::string& name) {
  const auto found = app.get_subcommands([&](const CLI::App* s) { return s->get_name() == name; });
  return found.empty() ? nullptr : found.front();
}

std::vector<std::string> names_of_subcommands(const CLI::App& app) {
  std::vector<std::string> out;
  for (const CLI::App* s : app.get_subcommands([](const CLI::App*) { return true; }))
    if (!s->get_group().empty()) out.push_back(s->get_name());
  return out;
}

std::vector<std::string> names_of_options(const CLI::App& app) {
  std::vector<std::string> out;
  for (const CLI::Option* option : app.get_options())
    for (const std::string& name : option->get_lnames()) out.push_back("--" + name);
  return out;
}

Error unknown(const std::string& word, const std::string& kind, const std::string& command,
              const std::vector<std::string>& known) {
  const std::string nearest = nearest_word(word, known);
  // A word of which more than half would have to change was not meant.
  const bool near =
      !nearest.empty() && 2 * edit_distance(word, nearest) <= std::max(word.size(), nearest.size());
  return {word, "is no " + kind + " of " + command,
          (near ? "did you mean '" + nearest + "'? See " : "see ") + command + " --help"};
}

}  // namespace

std::optional<Error> find_unknown_word(const CLI::App& app, const std::vector<std::string>& words) {
  const CLI::App* at = &app;
  std::string command = "evpose";
  for (const std::string& word : words) {
    if (word == "--") return {};
    if (word.starts_with("--")) {
      const std::string name = word.substr(0, word.find('='));
      const auto known = names_of_options(*at);
      if (std::find(known.begin(), known.end(), name) == known.end())
        return unknown(name, "option", command, known);
    } else if (!word.starts_with('-')) {
      const auto known = names_of_subcommands(*at);
      if (known.empty()) continue;
      at = subcommand(*at, word);
      if (at == nullptr) return unknown(word, "command", command, known);
      command += " " + word;
    }
  }
  return {};
}

}  // namespace evpose
