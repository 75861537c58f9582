// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/report/assets.h"

#define EVPOSE_ASSET(name)                                                          \
  extern "C" const char evpose_asset_##name##_begin[], evpose_asset_##name##_end[]; \
  std::string_view evpose::assets::name() { return {evpose_asset_##name##_begin, evpose_asset_##name##_end}; }

EVPOSE_ASSET(report_html)
EVPOSE_ASSET(report_css)
EVPOSE_ASSET(report_js)
EVPOSE_ASSET(motion_js)
EVPOSE_ASSET(plotly_gz)
