// SPDX-License-Identifier: BSD-3-Clause
#include "learnt_flights.h"

#include <filesystem>

#include "evpose/io/files/atomic_file.h"

namespace evpose {

std::string LearntFlights::file(std::size_t number, const char* kind) const {
  return text(folder_, "/flight_", number, kind);
}

std::optional<LearntFlights::Flight> LearntFlights::read(std::size_t number,
                                                         const nlohmann::ordered_json& inputs) const {
  const auto content = read_text_file(file(number, ".json"));
  if (!content) return {};
  const auto kept = nlohmann::ordered_json::parse(*content, nullptr, false);
  if (!kept.is_object() || !kept.contains("report") ||
      kept.value("inputs", nlohmann::ordered_json()) != inputs)
    return {};
  auto map = read_map_h5(file(number, ".h5"));
  if (!map) return {};
  return Flight{kept["report"], *std::move(map)};
}

Expected<ContourMap> LearntFlights::keep(std::size_t number, const nlohmann::ordered_json& inputs,
                                         const nlohmann::ordered_json& report, const ContourMap& map) const {
  std::error_code failed;
  std::filesystem::create_directories(folder_, failed);
  if (failed) return Error{folder_, "cannot be made: " + failed.message(), "check the folder's permissions"};
  // What is said of the map comes last: without it the map does not count.
  std::filesystem::remove(file(number, ".json"), failed);
  if (const auto ok = write_map_h5(file(number, ".h5"), map, "", placement_); !ok) return ok.error();
  const nlohmann::ordered_json kept{{"inputs", inputs}, {"report", report}};
  if (const auto ok = write_text_file(file(number, ".json"), kept.dump(2) + "\n"); !ok) return ok.error();
  return read_map_h5(file(number, ".h5"));
}

bool LearntFlights::any() const {
  std::error_code ignored;
  return std::filesystem::exists(file(0, ".json"), ignored);
}

void LearntFlights::remove() const {
  std::error_code ignored;
  for (std::size_t i = 0; std::filesystem::exists(file(i, ".h5"), ignored); ++i)
    for (const char* kind : {".json", ".h5"}) std::filesystem::remove(file(i, kind), ignored);
  std::filesystem::remove(folder_, ignored);  // unless it holds what is not ours
}

}  // namespace evpose
