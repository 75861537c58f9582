// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/camera/camera.h"

#include <algorithm>
#include <cmath>

#include "evpose/camera/double_sphere.h"
#include "evpose/camera/kannala_brandt.h"
#include "evpose/camera/pinhole_radtan.h"

namespace evpose {
namespace {

Status check_numbers(const CameraIntrinsics& c) {
  if (c.size.width <= 0 || c.size.height <= 0 || c.size.width > 32767 || c.size.height > 32767)
    return Error{"resolution", text("is ", c.size.width, " x ", c.size.height),
                 "give width and height between 1 and 32767 px"};
  if (!std::isfinite(c.fx) || !std::isfinite(c.fy) || !(c.fx > 0) || !(c.fy > 0))
    return Error{"intrinsics", text("focal lengths are ", c.fx, ", ", c.fy),
                 "give [fu, fv, pu, pv] in px, fu and fv > 0"};
  if (!std::isfinite(c.cx) || !std::isfinite(c.cy))
    return Error{"intrinsics", "the principal point is not a number", "give [fu, fv, pu, pv] in px"};
  if (!std::all_of(c.distortion.begin(), c.distortion.end(), [](double k) { return std::isfinite(k); }))
    return Error{"distortion_coeffs", "not all are numbers", "calibrate again or copy the file anew"};
  return {};
}

Status check_model(const CameraIntrinsics& c) {
  const std::string& model = c.distortion_model;
  const std::size_t n = c.distortion.size();
  if (model != "radtan" && model != "equidistant" && model != "ds" && model != "none")
    return Error{"distortion_model", text("'", model, "' is not implemented"),
                 "calibrate with pinhole and radtan, equidistant or none, or with ds"};
  if (model == "ds" && n != 2)
    return Error{"distortion_coeffs", text("ds has 2 numbers, not ", n), "give xi alpha"};
  if (model == "ds" &&
      !(c.distortion[0] > -1 && c.distortion[0] <= 1 && c.distortion[1] >= 0 && c.distortion[1] <= 1))
    return Error{"distortion_coeffs", text("ds has xi = ", c.distortion[0], ", alpha = ", c.distortion[1]),
                 "xi lies between -1 and 1, alpha between 0 and 1"};
  if (model == "radtan" && n != 4 && n != 5)
    return Error{"distortion_coeffs", text("radtan has 4 or 5 numbers, not ", n), "give k1 k2 p1 p2 [k3]"};
  if (model == "equidistant" && n != 4)
    return Error{"distortion_coeffs", text("equidistant has 4 numbers, not ", n), "give k1 k2 k3 k4"};
  if (model == "none" && n != 0)
    return Error{"distortion_coeffs", text("none has no numbers, not ", n),
                 "leave the list empty or name the model"};
  return {};
}

// A camera whose rays exist at the corners of the central half of the image can be used; the rim may be
// invalid.
bool sees_central_region(const Camera& camera) {
  const Eigen::Vector2d last(camera.size().width - 1, camera.size().height - 1);
  for (const double u : {0.25, 0.75}) {
    for (const double v : {0.25, 0.75}) {
      if (!camera.unproject({u * last.x(), v * last.y()})) return false;
    }
  }
  return true;
}

}  // namespace

Expected<std::shared_ptr<const Camera>> make_camera(const CameraIntrinsics& intrinsics) {
  if (const Status numbers = check_numbers(intrinsics); !numbers) return numbers.error();
  if (const Status model = check_model(intrinsics); !model) return model.error();
  std::shared_ptr<const Camera> camera;
  if (intrinsics.distortion_model == "equidistant") {
    camera = std::make_shared<KannalaBrandt>(intrinsics);
  } else if (intrinsics.distortion_model == "ds") {
    camera = std::make_shared<DoubleSphere>(intrinsics);
  } else {
    camera = std::make_shared<PinholeRadtan>(intrinsics);
  }
  if (!sees_central_region(*camera))
    return Error{"distortion_coeffs", "the distortion folds back inside the central half of the image",
                 "check the coefficients' order and sign, and the focal lengths' unit (px)"};
  return camera;
}

}  // namespace evpose
