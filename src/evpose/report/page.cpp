// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/report/page.h"

#include "evpose/core/error.h"
#include "evpose/report/assets.h"
#include "evpose/report/html_text.h"
#include "evpose/report/series.h"

namespace evpose {
namespace {

/// In JSON `<` can only stand inside strings, where this means the same to JSON and nothing to HTML.
std::string escaped_json(const std::string& json) {
  std::string out;
  out.reserve(json.size());
  for (const char c : json) {
    if (c == '<')
      out += "\\u003c";
    else
      out += c;
  }
  return out;
}

/// Scripts of ours and of the plot library are text that no `</script>` may end early.
std::string_view checked_script(std::string_view script) {
  EVPOSE_CHECK(script.find("</script") == std::string_view::npos);
  return script;
}

}  // namespace

std::string page_html(const std::string& title, const std::string& data_json) {
  const std::string safe_title = escaped_html(title), safe_data = escaped_json(data_json);
  const std::string plotly = base64(assets::plotly_gz());
  const auto part = [&](std::string_view name) -> std::string_view {
    if (name == "TITLE") return safe_title;
    if (name == "STYLE") return assets::report_css();
    if (name == "DATA") return safe_data;
    if (name == "PLOTLY") return plotly;
    if (name == "MOTION") return checked_script(assets::motion_js());
    EVPOSE_CHECK(name == "SCRIPT");
    return checked_script(assets::report_js());
  };
  // One pass over the shell: what is put in is not searched again.
  std::string_view shell = assets::report_html();
  std::string out;
  out.reserve(plotly.size() + safe_data.size() + (1u << 16));
  for (std::size_t at = shell.find('@'); at != std::string_view::npos; at = shell.find('@')) {
    const std::size_t end = shell.find('@', at + 1);
    EVPOSE_CHECK(end != std::string_view::npos);
    out += shell.substr(0, at);
    out += part(shell.substr(at + 1, end - at - 1));
    shell.remove_prefix(end + 1);
  }
  return out += shell;
}

}  // namespace evpose
