// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

namespace evpose::fuzz {

using Bytes = std::span<const std::uint8_t>;

struct Target {
  const char* name;
  void (*run)(Bytes);
};
/// All targets of the program, in no order.
std::vector<Target>& targets();
/// Null: there is none of that name.
const Target* find_target(const std::string& name);

struct Registration {
  explicit Registration(const Target& target) { targets().push_back(target); }
};

/// The name under which stat() and fopen() find these bytes, until the next call: readers are tried as they
/// are used, by name, but without the cost of a file.
std::string as_file(Bytes bytes);
/// The same for libraries that open files by themselves: a real one, in memory where there is such a place.
std::string as_real_file(Bytes bytes);

/// Reads all events of a file, and holds them to what an EventReader promises. `format` as of open_events().
void read_all_events(const std::string& path, const std::string& format);
/// Lists the streams of a file and reads what is no event.
void read_all_sensors(const std::string& path, const std::string& format);
/// Both, of a file with these bytes.
void read_all(Bytes bytes, const std::string& format);

}  // namespace evpose::fuzz

/// EVPOSE_FUZZ_TARGET(name) { ... } is tried with any content of `bytes`.
#define EVPOSE_FUZZ_TARGET(name)                                                                  \
  static void fuzz_##name(evpose::fuzz::Bytes bytes);                                             \
  static const evpose::fuzz::Registration registration_##name{{#name, fuzz_##name}}; /* NOLINT */ \
  static void fuzz_##name(evpose::fuzz::Bytes bytes)
