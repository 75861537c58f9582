// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <functional>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "evpose/core/error.h"

namespace evpose {

/// The named, documented, bounded values of one or more config structs. Defaults live in the structs; a
/// module offers `void describe(ConfigTable&, ItsConfig&)`. The table keeps references: it must not outlive
/// the structs.
class ConfigTable {
 public:
  struct Bounds {
    double min = -std::numeric_limits<double>::infinity();
    double max = std::numeric_limits<double>::infinity();
  };
  template <class E>
  using Choices = std::vector<std::pair<std::string, E>>;

  /// `unit` is empty for pure numbers. The key is prefixed by the open groups.
  void add(const std::string& key, double& value, const std::string& unit, const std::string& help,
           Bounds bounds);
  void add(const std::string& key, int& value, const std::string& unit, const std::string& help,
           Bounds bounds);
  void add(const std::string& key, bool& value, const std::string& help);
  void add(const std::string& key, std::string& value, const std::string& help);
  template <class E>
  void add(const std::string& key, E& value, const Choices<E>& choices, const std::string& help) {
    std::vector<std::string> names;
    for (const auto& c : choices) names.push_back(c.first);
    add_choice(
        key, names, help,
        [&value, choices] {
          std::size_t i = 0;
          while (i + 1 < choices.size() && choices[i].second != value) ++i;
          return i;
        },
        [&value, choices](std::size_t i) { value = choices[i].second; });
  }

  /// Adds what `describe` adds, under "name.".
  template <class Config>
  void group(const std::string& name, Config& config) {
    const std::string outer = prefix_;
    prefix_ += name + ".";
    describe(*this, config);
    prefix_ = outer;
  }

  /// Sets one key from text. `where` names the source in errors ("--set", "file.yaml:12").
  /// Unknown key: the error names the nearest known one. Nothing changes on error.
  Status set(const std::string& key, const std::string& value, const std::string& where);

  struct Value {
    std::string key, value, unit, help;
    bool number;  ///< value is a bare number or boolean in YAML and JSON
  };
  std::vector<Value> values() const;

  /// All keys, nested, as YAML with a comment and unit each; reading it back gives the same values.
  std::string to_yaml() const;

 private:
  struct Entry {
    std::string key, unit, help;
    bool number;
    std::function<std::string()> get;
    std::function<std::string(const std::string&)> set;  ///< returns what is wrong, empty when set
  };
  void add_choice(const std::string& key, const std::vector<std::string>& names, const std::string& help,
                  std::function<std::size_t()> get, std::function<void(std::size_t)> set);
  void add_entry(Entry entry);

  std::vector<Entry> entries_;
  std::string prefix_;
};

/// Letters to insert, remove or replace to make one of the other (Levenshtein).
std::size_t edit_distance(const std::string& a, const std::string& b);

/// The member of `known` nearest to `word` by edit distance; empty if there is none.
std::string nearest_word(const std::string& word, const std::vector<std::string>& known);

}  // namespace evpose
