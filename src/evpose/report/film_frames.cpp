// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/report/film_frames.h"

#include <cairo.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstring>

#include "evpose/report/series.h"

namespace evpose {
namespace {

using Colour = std::array<double, 3>;
constexpr Colour kInk{0.13, 0.13, 0.13}, kFaint{0.55, 0.55, 0.55}, kContour{0.72, 0.76, 0.74},
    kWay{0.80, 0.80, 0.80};
constexpr int kPanel = 400, kMargin = 16, kLeastHeight = 480, kLeastWidth = 640;
constexpr double kTextTop = 232, kStrip = 110;  // px: of words and numbers above, of time below
constexpr double kLine = 19;                    // px, from line to line
constexpr std::size_t kDrawnPoints = 20'000;
constexpr TimeNs kRateOver = 50 * kNsPerMs;
constexpr double kFinest_mm = 0.1, kCoarsest_mm = 1000;  // ends of the sigma's log axis

Colour colour_of(Health health) {
  switch (health) {
    case Health::tracking:
      return {0.0, 0.55, 0.24};
    case Health::degraded:
    case Health::ambiguous:
      return {0.87, 0.56, 0.0};
    case Health::lost:
      return {0.80, 0.13, 0.13};
    case Health::waiting:
    case Health::initialising:
      return {0.45, 0.50, 0.60};
  }
  return kInk;
}

std::string words(const char* format, auto... values) {
  std::array<char, 200> out{};
  std::snprintf(out.data(), out.size(), format, values...);
  return out.data();
}

struct SurfaceDeleter {
  void operator()(cairo_surface_t* surface) const { cairo_surface_destroy(surface); }
};
using Surface = std::unique_ptr<cairo_surface_t, SurfaceDeleter>;

/// Draws on a surface while it lives.
class Pen {
 public:
  explicit Pen(cairo_surface_t* surface) : cairo_(cairo_create(surface)) {
    cairo_select_font_face(cairo_, "sans-serif", CAIRO_FONT_SLANT_NORMAL, CAIRO_FONT_WEIGHT_NORMAL);
    cairo_set_font_size(cairo_, 14);
    cairo_set_line_width(cairo_, 1.5);
  }
  ~Pen() { cairo_destroy(cairo_); }
  Pen(const Pen&) = delete;
  Pen& operator=(const Pen&) = delete;

  void colour(const Colour& c) { cairo_set_source_rgb(cairo_, c[0], c[1], c[2]); }
  void bold(bool on) {
    cairo_select_font_face(cairo_, "sans-serif", CAIRO_FONT_SLANT_NORMAL,
                           on ? CAIRO_FONT_WEIGHT_BOLD : CAIRO_FONT_WEIGHT_NORMAL);
  }
  void size(double px) { cairo_set_font_size(cairo_, px); }
  void text(double x, double y, const std::string& words) {
    cairo_move_to(cairo_, x, y);
    cairo_show_text(cairo_, words.c_str());
  }
  double width_of(const std::string& words) {
    cairo_text_extents_t extents;
    cairo_text_extents(cairo_, words.c_str(), &extents);
    return extents.x_advance;
  }
  void box(double x, double y, double width, double height) {
    cairo_rectangle(cairo_, x, y, width, height);
    cairo_fill(cairo_);
  }
  void line_to(double x, double y) { cairo_line_to(cairo_, x, y); }
  void move_to(double x, double y) { cairo_move_to(cairo_, x, y); }
  void stroke() { cairo_stroke(cairo_); }
  void fill() { cairo_fill(cairo_); }

 private:
  cairo_t* cairo_;
};

/// From the map's x and y to pixels: as large as fits, north up.
struct TopView {
  double x0 = 0, y0 = 0, scale = 1;  ///< of the map's origin, px; px/m
  double x(const Eigen::Vector3d& p) const { return x0 + scale * p.x(); }
  double y(const Eigen::Vector3d& p) const { return y0 - scale * p.y(); }
};

}  // namespace

struct FilmFrames::State {
  const RunFiles& run;
  int scale = 1, image_width = 0, image_height = 0, width = 0, height = 0;
  TopView top;
  Surface background;  ///< what all frames have in common

  double left() const { return image_width + kMargin; }
  double right() const { return width - kMargin; }
  double strip_top() const { return height - kStrip; }
  double time_x(TimeNs t) const {
    const double all = to_seconds(run.rows.back().t - run.rows.front().t);
    return left() + (right() - left()) * to_seconds(t - run.rows.front().t) / std::max(1e-9, all);
  }
  double sigma_y(double sigma_m) const {
    const double share = std::log(std::clamp(1e3 * sigma_m, kFinest_mm, kCoarsest_mm) / kFinest_mm) /
                         std::log(kCoarsest_mm / kFinest_mm);
    return height - 34 - share * (kStrip - 62);
  }
  void fit_top_view(const ContourMap& map);
  void draw_background(const ContourMap& map);
  void draw_time(Pen& pen) const;
  void draw_words(Pen& pen, std::size_t row) const;
  void draw_reason(Pen& pen, const RunRow& row, double y) const;
  void draw_way(Pen& pen, std::size_t row) const;
  double event_rate_mev_s(std::size_t row) const;
  void copy_overlay(const RgbImage& overlay, cairo_surface_t* to) const;
};

void FilmFrames::State::fit_top_view(const ContourMap& map) {
  Eigen::Vector2d low(1e300, 1e300), high = -low;
  const auto include = [&](const Eigen::Vector3d& p) {
    low = low.cwiseMin(p.head<2>()), high = high.cwiseMax(p.head<2>());
  };
  for (const std::size_t i : evenly_spaced_indices(map.points.size(), kDrawnPoints)) include(map.position(i));
  for (const RunRow& row : run.rows)
    if (row.valid()) include(row.T_map_body.p);
  if (!(low.x() <= high.x())) low.setZero(), high.setOnes();
  const double wide = right() - left(), tall = strip_top() - kTextTop - 2 * kMargin;
  const Eigen::Vector2d extent = (high - low).cwiseMax(0.1);
  top.scale = std::min(wide / extent.x(), tall / extent.y());
  const Eigen::Vector2d middle = 0.5 * (low + high);
  top.x0 = 0.5 * (left() + right()) - top.scale * middle.x();
  top.y0 = kTextTop + kMargin + 0.5 * tall + top.scale * middle.y();
}

void FilmFrames::State::draw_time(Pen& pen) const {
  pen.size(11);
  pen.colour(kFaint);
  pen.text(left(), strip_top() + 8, "position sigma, 0.1 mm to 1 m, and health over the run");
  for (std::size_t i = 0, end = 0; i + 1 < run.rows.size(); i = end) {  // stretches of one health
    while (end + 1 < run.rows.size() && run.rows[end].health == run.rows[i].health) ++end;
    pen.colour(colour_of(run.rows[i].health));
    const double x = time_x(run.rows[i].t);
    pen.box(x, height - 28, time_x(run.rows[end].t) - x, 10);
  }
  pen.colour(kInk);
  bool drawing = false;
  for (const std::size_t i : evenly_spaced_indices(run.rows.size(), 2000)) {
    const RunRow& row = run.rows[i];
    const double x = time_x(row.t), y = sigma_y(row.position_sigma_m());
    drawing&& row.valid() ? pen.line_to(x, y) : pen.move_to(x, y);
    drawing = row.valid();
  }
  pen.stroke();
}

void FilmFrames::State::draw_background(const ContourMap& map) {
  background.reset(cairo_image_surface_create(CAIRO_FORMAT_RGB24, width, height));
  Pen pen(background.get());
  pen.colour({1, 1, 1});
  pen.box(0, 0, width, height);
  pen.colour(kContour);
  for (const std::size_t i : evenly_spaced_indices(map.points.size(), kDrawnPoints)) {
    const Eigen::Vector3d p = map.position(i);
    pen.box(top.x(p) - 0.5, top.y(p) - 0.5, 1, 1);
  }
  pen.colour(kWay);
  for (const RunRow& row : run.rows)
    if (row.valid()) pen.line_to(top.x(row.T_map_body.p), top.y(row.T_map_body.p));
  pen.stroke();
  draw_time(pen);
}

double FilmFrames::State::event_rate_mev_s(std::size_t row) const {
  std::int64_t events = 0;
  std::size_t i = row;
  for (; i > 0 && run.rows[row].t - run.rows[i].t < kRateOver; --i) events += run.rows[i].events_read;
  const double span_s = to_seconds(run.rows[row].t - run.rows[i].t);
  return span_s > 0 ? 1e-6 * static_cast<double>(events) / span_s : 0;
}

void FilmFrames::State::draw_words(Pen& pen, std::size_t number) const {
  const RunRow& row = run.rows[number];
  pen.bold(true);
  pen.size(18);
  pen.colour(colour_of(row.health));
  pen.text(left(), 34, to_string(row.health));
  const std::string time = words("%.2f s", to_seconds(row.t - run.rows.front().t));
  pen.colour(kInk);
  pen.text(right() - pen.width_of(time), 34, time);
  pen.bold(false);
  pen.size(14);
  const Eigen::Vector3d& p = row.T_map_body.p;
  const std::array<std::string, 6> lines{
      words("x %.3f   y %.3f   z %.3f m", p.x(), p.y(), p.z()),
      words("position to %.1f mm (1 sigma)", 1e3 * row.position_sigma_m()),
      words("attitude to %.3f deg (1 sigma)", row.rotation_sigma_deg()),
      words("speed %.2f m/s", row.velocity.norm()),
      words("events %.2f million/s", event_rate_mev_s(number)),
      words("contours: %d of %d points matched", row.points_matched, row.points)};
  double y = 62;
  for (std::size_t i = 0; i < lines.size(); ++i, y += kLine)
    if (row.valid() || i >= 4) pen.text(left(), y, lines[i]);
  draw_reason(pen, row, y + 4);
}

void FilmFrames::State::draw_reason(Pen& pen, const RunRow& row, double y) const {
  pen.size(12);
  pen.colour(colour_of(row.health));
  std::string reason = row.reason;
  while (!reason.empty() && pen.width_of(reason) > right() - left()) reason.pop_back();
  pen.text(left(), y, reason);
}

void FilmFrames::State::draw_way(Pen& pen, std::size_t number) const {
  bool drawing = false;
  pen.colour(colour_of(Health::tracking));
  for (std::size_t i = 0; i <= number; ++i) {
    const RunRow& row = run.rows[i];
    const double x = top.x(row.T_map_body.p), y = top.y(row.T_map_body.p);
    if (row.valid()) drawing ? pen.line_to(x, y) : pen.move_to(x, y);
    drawing = row.valid();
  }
  pen.stroke();
  const RunRow& now = run.rows[number];
  if (now.valid()) {  // an arrow head towards the body's x
    const Eigen::Vector2d ahead = (now.T_map_body.q * Eigen::Vector3d::UnitX()).head<2>().normalized();
    const Eigen::Vector2d at(top.x(now.T_map_body.p), top.y(now.T_map_body.p)), to(ahead.x(), -ahead.y()),
        side(-to.y(), to.x());
    pen.colour(colour_of(now.health));
    for (const Eigen::Vector2d& corner :
         {Eigen::Vector2d(at + 11 * to), Eigen::Vector2d(at - 5 * to + 5 * side),
          Eigen::Vector2d(at - 5 * to - 5 * side)})
      pen.line_to(corner.x(), corner.y());
    pen.fill();
  }
  pen.colour(kInk);
  pen.box(time_x(now.t) - 1, strip_top() + 16, 2, kStrip - 32);
}

void FilmFrames::State::copy_overlay(const RgbImage& overlay, cairo_surface_t* to) const {
  cairo_surface_flush(to);
  unsigned char* const data = cairo_image_surface_get_data(to);
  const auto stride = static_cast<std::size_t>(cairo_image_surface_get_stride(to));
  for (int y = 0; y < image_height; ++y)
    for (int x = 0; x < image_width; ++x) {
      const std::uint8_t* const rgb =
          &overlay.rgb[3 * (static_cast<std::size_t>(y / scale) * static_cast<std::size_t>(overlay.width) +
                            static_cast<std::size_t>(x / scale))];
      const std::uint32_t value = std::uint32_t{rgb[0]} << 16 | std::uint32_t{rgb[1]} << 8 | rgb[2];
      std::memcpy(data + static_cast<std::size_t>(y) * stride + 4 * static_cast<std::size_t>(x), &value, 4);
    }
  cairo_surface_mark_dirty(to);
}

FilmFrames::FilmFrames(const RunFiles& run, const ContourMap& map, ImageSize overlay)
    : state_(new State{run, 1, 0, 0, 0, 0, {}, {}}) {
  State& s = *state_;
  s.scale = std::max(1, (kLeastWidth + overlay.width - 1) / overlay.width);
  s.image_width = s.scale * overlay.width;
  s.image_height = s.scale * overlay.height;
  s.width = (s.image_width + kPanel + 1) / 2 * 2;  // films have even sizes
  s.height = (std::max(s.image_height, kLeastHeight) + 1) / 2 * 2;
  s.fit_top_view(map);
  s.draw_background(map);
}

FilmFrames::~FilmFrames() = default;
int FilmFrames::width() const { return state_->width; }
int FilmFrames::height() const { return state_->height; }

RgbImage FilmFrames::draw(const RgbImage& overlay, std::size_t row) {
  const State& s = *state_;
  const Surface frame(cairo_image_surface_create(CAIRO_FORMAT_RGB24, s.width, s.height));
  const auto stride = static_cast<std::size_t>(cairo_image_surface_get_stride(frame.get()));
  unsigned char* const data = cairo_image_surface_get_data(frame.get());
  std::memcpy(data, cairo_image_surface_get_data(s.background.get()),
              stride * static_cast<std::size_t>(s.height));
  s.copy_overlay(overlay, frame.get());
  {
    Pen pen(frame.get());
    s.draw_words(pen, row);
    s.draw_way(pen, row);
  }
  cairo_surface_flush(frame.get());
  RgbImage out(s.width, s.height);
  for (int y = 0; y < s.height; ++y)
    for (int x = 0; x < s.width; ++x) {
      std::uint32_t value = 0;
      std::memcpy(&value, data + static_cast<std::size_t>(y) * stride + 4 * static_cast<std::size_t>(x), 4);
      std::uint8_t* const rgb = out.pixel(x, y);
      for (const int c : {0, 1, 2}) rgb[c] = static_cast<std::uint8_t>(value >> (16 - 8 * c));
    }
  return out;
}

}  // namespace evpose
