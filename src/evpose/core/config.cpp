// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/core/config.h"

#include <algorithm>
#include <charconv>
#include <cmath>

namespace evpose {
namespace {

std::string format(double value) {
  char buffer[40];
  const auto end =
      std::to_chars(buffer, buffer + sizeof buffer, value).ptr;  // shortest that reads back the same
  return {buffer, end};
}

bool parse(const std::string& s, double& out) {
  const char* first = s.data() + (s.starts_with('+') ? 1 : 0);
  const auto r = std::from_chars(first, s.data() + s.size(), out);
  return r.ec == std::errc() && r.ptr == s.data() + s.size() && std::isfinite(out);
}

bool parse(const std::string& s, int& out) {
  const auto r = std::from_chars(s.data(), s.data() + s.size(), out);
  return r.ec == std::errc() && r.ptr == s.data() + s.size();
}

std::string outside(const ConfigTable::Bounds& b, double v, const std::string& unit) {
  if (v >= b.min && v <= b.max) return "";
  return text(format(v), " is outside ", format(b.min), " .. ", format(b.max), unit.empty() ? "" : " ", unit);
}

}  // namespace

std::size_t edit_distance(const std::string& a, const std::string& b) {
  std::vector<std::size_t> row(b.size() + 1);
  for (std::size_t j = 0; j <= b.size(); ++j) row[j] = j;
  for (std::size_t i = 1; i <= a.size(); ++i) {
    std::size_t diagonal = row[0];
    row[0] = i;
    for (std::size_t j = 1; j <= b.size(); ++j) {
      const std::size_t substitute = diagonal + (a[i - 1] != b[j - 1]);
      diagonal = row[j];
      row[j] = std::min({row[j] + 1, row[j - 1] + 1, substitute});
    }
  }
  return row[b.size()];
}

std::string nearest_word(const std::string& word, const std::vector<std::string>& known) {
  std::string best;
  std::size_t best_distance = std::numeric_limits<std::size_t>::max();
  for (const auto& k : known) {
    std::size_t d = edit_distance(word, k);
    // A bare last part ("rate_hz" for "update.rate_hz") is the commonest slip.
    if (const auto dot = k.rfind('.'); dot != std::string::npos)
      d = std::min(d, edit_distance(word, k.substr(dot + 1)) + 1);
    if (d < best_distance) best_distance = d, best = k;
  }
  return best;
}

void ConfigTable::add_entry(Entry entry) {
  entry.key = prefix_ + entry.key;
  for (const auto& e : entries_) EVPOSE_CHECK(e.key != entry.key);
  entries_.push_back(std::move(entry));
}

void ConfigTable::add(const std::string& key, double& value, const std::string& unit, const std::string& help,
                      Bounds bounds) {
  add_entry({key, unit, help, true, [&value] { return format(value); },
             [&value, bounds, unit](const std::string& s) -> std::string {
               double v = 0;
               if (!parse(s, v)) return "'" + s + "' is not a number";
               std::string wrong = outside(bounds, v, unit);
               if (wrong.empty()) value = v;
               return wrong;
             }});
}

void ConfigTable::add(const std::string& key, int& value, const std::string& unit, const std::string& help,
                      Bounds bounds) {
  add_entry({key, unit, help, true, [&value] { return std::to_string(value); },
             [&value, bounds, unit](const std::string& s) -> std::string {
               int v = 0;
               if (!parse(s, v)) return "'" + s + "' is not a whole number";
               std::string wrong = outside(bounds, v, unit);
               if (wrong.empty()) value = v;
               return wrong;
             }});
}

void ConfigTable::add(const std::string& key, bool& value, const std::string& help) {
  add_entry({key, "", help, true, [&value] { return value ? "true" : "false"; },
             [&value](const std::string& s) -> std::string {
               if (s != "true" && s != "false") return "'" + s + "' is neither true nor false";
               value = s == "true";
               return "";
             }});
}

void ConfigTable::add(const std::string& key, std::string& value, const std::string& help) {
  add_entry({key, "", help, false, [&value] { return value; },
             [&value](const std::string& s) -> std::string {
               value = s;
               return "";
             }});
}

void ConfigTable::add_choice(const std::string& key, const std::vector<std::string>& names,
                             const std::string& help, std::function<std::size_t()> get,
                             std::function<void(std::size_t)> set) {
  std::string list;
  for (const auto& n : names) list += (list.empty() ? "" : " | ") + n;
  add_entry({key, "", help + " (" + list + ")", false, [names, get = std::move(get)] { return names[get()]; },
             [names, set = std::move(set), list](const std::string& s) -> std::string {
               const auto it = std::find(names.begin(), names.end(), s);
               if (it == names.end()) return "'" + s + "' is none of " + list;
               set(static_cast<std::size_t>(it - names.begin()));
               return "";
             }});
}

Status ConfigTable::set(const std::string& key, const std::string& value, const std::string& where) {
  for (auto& e : entries_) {
    if (e.key != key) continue;
    const std::string wrong = e.set(value);
    if (wrong.empty()) return {};
    return Error{where, key + ": " + wrong, e.help};
  }
  std::vector<std::string> keys;
  for (const auto& e : entries_) keys.push_back(e.key);
  return Error{where, "unknown key '" + key + "'", "did you mean '" + nearest_word(key, keys) + "'?"};
}

std::vector<ConfigTable::Value> ConfigTable::values() const {
  std::vector<Value> out;
  for (const auto& e : entries_) out.push_back({e.key, e.get(), e.unit, e.help, e.number});
  return out;
}

std::string ConfigTable::to_yaml() const {
  std::string out;
  std::vector<std::string> open;
  for (const auto& e : entries_) {
    std::vector<std::string> parts;
    std::stringstream stream(e.key);
    for (std::string part; std::getline(stream, part, '.');) parts.push_back(part);
    std::size_t depth = 0;
    while (depth < open.size() && depth + 1 < parts.size() && open[depth] == parts[depth]) ++depth;
    open.resize(depth);
    for (; depth + 1 < parts.size(); ++depth) {
      out += std::string(2 * depth, ' ') + parts[depth] + ":\n";
      open.push_back(parts[depth]);
    }
    std::string value = e.get();
    if (!e.number) {
      std::string quoted = "\"";
      for (char c : value) quoted += (c == '"' || c == '\\') ? std::string("\\") + c : std::string(1, c);
      value = quoted + "\"";
    }
    out += std::string(2 * depth, ' ') + parts.back() + ": " + value + "  # " + e.help +
           (e.unit.empty() ? "" : " [" + e.unit + "]") + "\n";
  }
  return out;
}

}  // namespace evpose
