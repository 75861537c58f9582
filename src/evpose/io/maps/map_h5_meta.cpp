// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/io/maps/map_h5_meta.h"

#include <array>
#include <cstdio>

#include "evpose/io/files/crc32.h"

namespace evpose {
namespace {

template <class... Args>
std::string formatted(const char* format, Args... args) {
  std::array<char, 64> buffer{};
  const int size = std::snprintf(buffer.data(), buffer.size(), format, args...);
  return {buffer.data(), static_cast<std::size_t>(size)};
}

template <class Items, class Print>
std::string joined(const Items& items, const Print& print) {
  std::string out;
  for (std::size_t i = 0; i < items.size(); ++i) {
    if (i > 0) out += ',';
    out += print(items[i]);
  }
  return out;
}

}  // namespace

Expected<std::uint32_t> map_checksum(const Hdf5File& file) {
  std::string lines;
  for (const std::string& name : file.datasets()) {
    const auto dataset = file.dataset(name);
    if (!dataset) return dataset.error();
    const auto crc = dataset->attribute_u32("crc32");
    if (!crc)
      return Error{file.path() + ": " + name, "has no checksum (attribute crc32)", "write the map again"};
    lines += name + " " + joined(dataset->shape(), [](std::uint64_t n) { return std::to_string(n); }) + " " +
             formatted("%08x", *crc) + "\n";
  }
  for (const std::string& name : file.attributes("/meta")) {
    if (name == "crc") continue;
    std::string value;
    if (const auto numbers = file.attribute_numbers("/meta", name)) {
      value = joined(*numbers, [](double v) { return formatted("%.17g", v); });
    } else if (const auto strings = file.attribute_strings("/meta", name)) {
      value = joined(*strings, [](const std::string& s) { return s; });
    } else {
      return Error{file.path() + ": /meta", "attribute " + name + " is neither numbers nor text",
                   "write the map again"};
    }
    lines += name + "=" + value + "\n";
  }
  return crc32(lines.data(), lines.size());
}

}  // namespace evpose
