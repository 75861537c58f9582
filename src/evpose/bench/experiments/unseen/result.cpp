// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/bench/experiments/unseen/result.h"

#include <nlohmann/json.hpp>

namespace evpose::experiments::unseen {
namespace {

using Json = nlohmann::ordered_json;

/// Words of a draw under their keys.
template <class Visit>
void visit_words(auto& draw, Visit&& visit) {
  visit("scene", draw.scene);
  visit("light", draw.light);
  visit("motion", draw.motion);
  visit("camera", draw.camera);
  visit("sensors", draw.sensors);
  visit("map", draw.map);
  visit("calibration", draw.calibration);
}

/// Values of a run under their keys.
template <class Visit>
void visit_figures(auto& run, Visit&& visit) {
  visit("fault", run.fault);
  visit("ate_mm", run.ate_mm);
  visit("ate_max_mm", run.ate_max_mm);
  visit("are_deg", run.are_deg);
  visit("nees6", run.nees6);
  visit("nees_by_direction", run.nees_by_direction);
  visit("tracking", run.tracking);
  visit("ate_tracking_mm", run.ate_tracking_mm);
  visit("poses", run.poses);
  visit("silent", run.silent);
  visit("at_end", run.at_end);
}

/// Takes a value out; throws what the library throws where it is missing or of another kind.
constexpr auto reader(const Json& from) {
  return [&from](const char* key, auto& value) { from.at(key).get_to(value); };
}

constexpr auto writer(Json& to) {
  return [&to](const char* key, const auto& value) { to[key] = value; };
}

SeedResult parse(const Json& json) {
  SeedResult out;
  const auto read = reader(json);
  read("seed", out.seed);
  read("key", out.key);
  visit_words(out.draw, read);
  read("settings", out.draw.settings);
  read("refused", out.refused);
  read("duration_s", out.duration_s);
  read("mev_s", out.mev_s);
  for (std::size_t g = 0; g < kGivens; ++g) visit_figures(out.runs[g], reader(json.at(kGivenKeys[g])));
  return out;
}

}  // namespace

std::string to_json(const SeedResult& result) {
  Json json;
  const auto write = writer(json);
  write("seed", result.seed);
  write("key", result.key);
  visit_words(result.draw, write);
  write("settings", result.draw.settings);
  write("refused", result.refused);
  write("duration_s", result.duration_s);
  write("mev_s", result.mev_s);
  for (std::size_t g = 0; g < kGivens; ++g) visit_figures(result.runs[g], writer(json[kGivenKeys[g]]));
  return json.dump();
}

Expected<SeedResult> from_json(const std::string& line, const std::string& where) {
  try {
    return parse(Json::parse(line));
  } catch (const Json::exception& e) {
    return Error{where, text("no result of a seed: ", e.what()), "make it anew with `evpose bench unseen`"};
  }
}

}  // namespace evpose::experiments::unseen
