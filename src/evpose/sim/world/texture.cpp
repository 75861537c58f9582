// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/sim/world/texture.h"

#include <algorithm>
#include <cmath>

#include "evpose/core/error.h"

namespace evpose::sim {
namespace {

constexpr float kWhite = 65535;
/// Largest number of samples along the footprint at a grazing angle. Beyond it the footprint is widened
/// across.
constexpr int kMostTaps = 8;

// Texels of one level.
struct Grid {
  int columns, rows;
  std::vector<std::uint16_t> values;
};

// The level that is half as fine.
Grid halved(const Grid& fine) {
  Grid coarse{(fine.columns + 1) / 2, (fine.rows + 1) / 2, {}};
  coarse.values.reserve(static_cast<std::size_t>(coarse.columns) * coarse.rows);
  // Halving an odd length would shift the texture, hence the mean over the exact span.
  const double ratio_u = static_cast<double>(fine.columns) / coarse.columns,
               ratio_v = static_cast<double>(fine.rows) / coarse.rows;
  const auto spans = [](int i, double ratio, int n, int* first, double* weights) {
    const double low = i * ratio, high = low + ratio;
    *first = static_cast<int>(low);
    int count = 0;
    for (int k = *first; k < n && k < high - 1e-9; ++k)
      weights[count++] = std::min(high, k + 1.0) - std::max(low, static_cast<double>(k));
    return count;
  };
  for (int row = 0; row < coarse.rows; ++row) {
    int first_row = 0, first_column = 0;
    double by_row[4], by_column[4];
    const int rows = spans(row, ratio_v, fine.rows, &first_row, by_row);
    for (int column = 0; column < coarse.columns; ++column) {
      const int columns = spans(column, ratio_u, fine.columns, &first_column, by_column);
      double sum = 0, weight = 0;
      for (int j = 0; j < rows; ++j) {
        for (int i = 0; i < columns; ++i) {
          const double w = by_row[j] * by_column[i];
          sum += w * fine.values[static_cast<std::size_t>(first_row + j) * fine.columns + first_column + i];
          weight += w;
        }
      }
      coarse.values.push_back(static_cast<std::uint16_t>(std::lround(sum / weight)));
    }
  }
  return coarse;
}

}  // namespace

void Texture::add_level(int columns, int rows, const std::vector<std::uint16_t>& values) {
  columns_.push_back(static_cast<float>(columns));
  rows_.push_back(static_cast<float>(rows));
  first_.push_back(static_cast<std::int32_t>(values_.size()));
  stride_.push_back(columns + 1);
  for (int row = 0; row <= rows; ++row) {
    const auto from = values.begin() + static_cast<std::ptrdiff_t>(row % rows) * columns;
    values_.insert(values_.end(), from, from + columns);
    values_.push_back(*from);
  }
}

Texture::Texture(double width_m, double height_m, double texel_m, const Pattern& pattern)
    : width_(static_cast<float>(width_m)), height_(static_cast<float>(height_m)) {
  EVPOSE_CHECK(width_m > 0 && height_m > 0 && texel_m > 0);
  // Whole numbers of texels: the rectangle repeats without a cut texel.
  Grid grid{std::max(1, static_cast<int>(std::lround(width_m / texel_m))),
            std::max(1, static_cast<int>(std::lround(height_m / texel_m))),
            {}};
  texel_ = static_cast<float>(texel_m);
  const double step_u = width_m / grid.columns, step_v = height_m / grid.rows;
  const std::size_t texels = static_cast<std::size_t>(grid.columns) * grid.rows;
  EVPOSE_CHECK(texels < (std::size_t{1} << 30));
  grid.values.reserve(texels);
  for (int row = 0; row < grid.rows; ++row) {
    for (int column = 0; column < grid.columns; ++column) {
      const double value = std::clamp(pattern((column + 0.5) * step_u, (row + 0.5) * step_v), 0.0, 1.0);
      grid.values.push_back(static_cast<std::uint16_t>(std::lround(value * kWhite)));
    }
  }
  values_.reserve(texels * 3 / 2);
  add_level(grid.columns, grid.rows, grid.values);
  while (grid.columns > 1 || grid.rows > 1) {
    grid = halved(grid);
    add_level(grid.columns, grid.rows, grid.values);
  }
  values_.shrink_to_fit();
}

template <class V>
struct Texture::Level {
  V columns, rows;
  typename LaneTypes<V>::Int first, stride;  // in values_
};

template <class V>
Texture::Level<V> Texture::level(typename LaneTypes<V>::Int number) const {
  return {gather(columns_.data(), number), gather(rows_.data(), number), gather(first_.data(), number),
          gather(stride_.data(), number)};
}

// Bilinear; (u, v) as fractions of the rectangle, in [0, 1].
template <class V>
V Texture::sample(const Level<V>& level, V u, V v) const {
  using Int = typename LaneTypes<V>::Int;
  const V &columns = level.columns, &rows = level.rows;
  V x = u * columns - 0.5F, y = v * rows - 0.5F;
  x = select(x < 0.0F, V(x + columns), x);
  y = select(y < 0.0F, V(y + rows), y);
  x = select(x < columns, x, all<V>(0));  // also where it is not a number
  y = select(y < rows, y, all<V>(0));
  const Int i = to_int(x), j = to_int(y);
  const V a = x - to_float(i), b = y - to_float(j);
  const Int at = level.first + j * level.stride + i;
  const Int low = gather_pair(values_.data(), at), high = gather_pair(values_.data(), Int(at + level.stride));
  const auto mix = [&a](Int pair) {
    const V from = to_float(Int(pair & 0xFFFF)), to = to_float(Int((pair >> 16) & 0xFFFF));
    return V(from + a * (to - from));
  };
  const V bottom = mix(low), top = mix(high);
  return bottom + b * (top - bottom);
}

// The footprint as taps along its major axis.
template <class V>
struct Texture::Filter {
  typename LaneTypes<V>::Int taps, fine, coarse;
  V blend, axis_u, axis_v, major, step;
};

template <class V>
Texture::Filter<V> Texture::filter(const Footprint<V>& p) const {
  using Int = typename LaneTypes<V>::Int;
  Filter<V> out;
  // Principal axes of the parallelogram: of the matrix [a b], as those of its second moment.
  const V uu = p.a_u * p.a_u + p.b_u * p.b_u, vv = p.a_v * p.a_v + p.b_v * p.b_v,
          uv = p.a_u * p.a_v + p.b_u * p.b_v;
  const V half_trace = 0.5F * (uu + vv), half_difference = 0.5F * (uu - vv);
  const V spread = root(V(half_difference * half_difference + uv * uv));
  out.major = root(V(half_trace + spread));
  const V minor = root(larger(V(half_trace - spread), all<V>(0)));
  V across = select(minor > texel_, minor, all<V>(texel_));
  const auto is_long = out.major > 1.2F * across;
  const V wanted = smaller(V(out.major / across), all<V>(static_cast<float>(kMostTaps)));
  const Int whole = to_int(wanted);
  const Int taps = select(to_float(whole) < wanted, Int(whole + 1), whole);
  out.taps = select(is_long, taps, Int(Int{} + 1));
  out.step = out.major / to_float(out.taps);
  across = select(is_long, larger(across, out.step), across);
  // Mipmap level and weight of the next one: a footprint of 2^k (1 + f) texels blends f of level k + 1 into
  // k.
  const Int raw = bits(V(across / texel_));
  const auto last = static_cast<std::int32_t>(columns_.size()) - 1;
  const Int exponent = (raw >> 23) - 127, most = Int{} + last;
  const V mantissa = from_bits(Int((raw & 0x007FFFFF) | 0x3F800000));
  out.fine = smaller(larger(exponent, Int{}), most);
  out.coarse = smaller(Int(out.fine + 1), most);
  out.blend = select(out.fine < last, V(mantissa - 1.0F), all<V>(0));
  // Unit vector along the major axis.
  const auto upright = half_difference < 0.0F;
  const V axis_u = select(upright, uv, V(spread + half_difference)),
          axis_v = select(upright, V(spread - half_difference), uv);
  const V length = root(V(axis_u * axis_u + axis_v * axis_v));
  const auto known = length > 0.0F;
  out.axis_u = select(known, V(axis_u / length), all<V>(1));
  out.axis_v = select(known, V(axis_v / length), all<V>(0));
  return out;
}

template <class V>
V Texture::mean(const Footprint<V>& at) const {
  const Filter<V> f = filter(at);
  const bool blends = any(f.blend > 0.0F);
  const Level<V> fine = level<V>(f.fine), coarse = level<V>(f.coarse);
  V sum{};
  for (std::int32_t i = 0; any(i < f.taps); ++i) {
    const V along = (static_cast<float>(i) + 0.5F) * f.step - 0.5F * f.major;
    V u = (at.u + along * f.axis_u) / width_, v = (at.v + along * f.axis_v) / height_;
    u = u - round_down(u);
    v = v - round_down(v);
    V value = sample(fine, u, v);
    if (blends) value = value + f.blend * (sample(coarse, u, v) - value);
    sum = sum + select(i < f.taps, value, all<V>(0));
  }
  return sum / (kWhite * to_float(f.taps));
}
template float Texture::mean(const Footprint<float>&) const;
template FloatLanes Texture::mean(const Footprint<FloatLanes>&) const;

float Texture::mean(float u_m, float v_m, const Eigen::Vector2f& a_m, const Eigen::Vector2f& b_m) const {
  return mean(Footprint<float>{u_m, v_m, a_m.x(), a_m.y(), b_m.x(), b_m.y()});
}

std::size_t Texture::bytes() const { return values_.size() * sizeof(std::uint16_t); }

}  // namespace evpose::sim
