// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string_view>

namespace evpose::assets {

// Files of web/, linked into the program (assets.S).
std::string_view report_html();
std::string_view report_css();
std::string_view report_js();
std::string_view motion_js();
std::string_view plotly_gz();  ///< packed by web/pack.js

}  // namespace evpose::assets
