// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>

#include "evpose/core/error.h"
#include "evpose/io/maps/map_h5.h"

namespace evpose {

/// What the flights that are done have made of a map, kept in a folder beside the output, so that learning
/// that was interrupted goes on after them. Every next flight begins with the map as it was read from there,
/// whether it was interrupted or not: the bytes are the same.
class LearntFlights {
 public:
  LearntFlights(const std::string& output, MapPlacement placement)
      : folder_(output + ".partial"), placement_(std::move(placement)) {}

  struct Flight {
    nlohmann::ordered_json report;
    ContourMap map;
  };
  /// As it was kept under the same `inputs`; none: it has to be learnt from.
  std::optional<Flight> read(std::size_t number, const nlohmann::ordered_json& inputs) const;
  /// Keeps it; the map as read() will give it.
  Expected<ContourMap> keep(std::size_t number, const nlohmann::ordered_json& inputs,
                            const nlohmann::ordered_json& report, const ContourMap& map) const;
  bool any() const;
  /// When all is done.
  void remove() const;
  const std::string& folder() const { return folder_; }

 private:
  std::string file(std::size_t number, const char* kind) const;

  std::string folder_;
  MapPlacement placement_;
};

}  // namespace evpose
