// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/io/calibration/calibration_kinds.h"

#include <cmath>

namespace evpose {

Expected<const YamlNode*> required(const YamlDocument& document, const YamlNode& parent,
                                   const std::string& key) {
  const YamlNode* node = parent.find(key);
  if (node == nullptr)
    return document.error(parent, "'" + key + "' is missing",
                          "add it, as the tool that calibrates writes it");
  return node;
}

Expected<double> required_number(const YamlDocument& document, const YamlNode& parent,
                                 const std::string& key) {
  const auto node = required(document, parent, key);
  if (!node) return node.error();
  return document.number(**node, key);
}

Expected<std::vector<double>> required_numbers(const YamlDocument& document, const YamlNode& parent,
                                               const std::string& key, std::size_t count) {
  const auto node = required(document, parent, key);
  if (!node) return node.error();
  return document.numbers(**node, key, count);
}

Expected<std::optional<Pose>> optional_transform(const YamlDocument& document, const YamlNode& parent,
                                                 const std::string& key) {
  const YamlNode* node = parent.find(key);
  if (node == nullptr) return std::optional<Pose>();
  const auto pose = document.transform(*node, key);
  if (!pose) return pose.error();
  return std::optional<Pose>(*pose);
}

Expected<ImageSize> image_size(const YamlDocument& document, const YamlNode& node, double width,
                               double height) {
  for (const double n : {width, height})
    if (!(n >= 1 && n <= 32767) || n != std::floor(n))
      return document.error(node, text("resolution: ", n, " is not a number of pixels"),
                            "write [width, height]");
  return ImageSize{static_cast<int>(width), static_cast<int>(height)};
}

Expected<ImageSize> image_size_of(const YamlDocument& document, const YamlNode& parent,
                                  const std::string& width, const std::string& height) {
  const auto w = required_number(document, parent, width);
  if (!w) return w.error();
  const auto h = required_number(document, parent, height);
  if (!h) return h.error();
  return image_size(document, *parent.find(width), *w, *h);
}

std::string distortion_name(const std::string& theirs) {
  if (theirs == "plumb_bob" || theirs == "radial-tangential" || theirs == "radtan" || theirs == "PINHOLE" ||
      theirs == "PinHole")
    return "radtan";
  if (theirs == "equidistant" || theirs == "fisheye" || theirs == "equi" || theirs == "kb4" ||
      theirs == "KANNALA_BRANDT" || theirs == "KannalaBrandt8")
    return "equidistant";
  if (theirs == "none" || theirs.empty()) return "none";
  return theirs;
}

Status set_distortion(const YamlDocument& document, const YamlNode& node, const std::string& model,
                      std::vector<double> numbers, CameraIntrinsics& out) {
  const std::size_t least = model == "radtan" || model == "equidistant" ? 4 : model == "ds" ? 2 : 0;
  const std::size_t most = model == "radtan" ? 5 : least;
  const bool ours = least > 0 || model == "none";
  // OpenCV pads with zeros; of k3 = 0 nothing needs to be kept.
  while (ours && numbers.size() > least && numbers.back() == 0) numbers.pop_back();
  if (ours && (numbers.size() < least || numbers.size() > most))
    return document.error(node, text("distortion: ", numbers.size(), " numbers, ", model, " has ", least),
                          "correct the list or the model");
  out.distortion_model = model;
  out.distortion = std::move(numbers);
  return {};
}

}  // namespace evpose
