// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <pybind11/pybind11.h>

#include "evpose/core/error.h"

namespace evpose {

/// The value, or a Python ValueError with the one line that says what is wrong.
template <class T>
T value_of(Expected<T> expected) {
  if (!expected) throw pybind11::value_error(expected.error().line());
  return std::move(*expected);
}

/// A setting of Python as the configuration's text.
inline std::string setting_text(const pybind11::object& setting) {
  if (pybind11::isinstance<pybind11::bool_>(setting)) return setting.cast<bool>() ? "true" : "false";
  return pybind11::str(setting);
}

/// Recordings, maps and runs as arrays; what makes maps and runs.
void bind_recordings(pybind11::module_& m);
void bind_maps(pybind11::module_& m);
void bind_runs(pybind11::module_& m);

}  // namespace evpose
