// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/map/board.h"

#include <charconv>
#include <cmath>
#include <vector>

namespace evpose {
namespace {

std::string joined(const char* kind, int columns, int rows, std::initializer_list<double> lengths) {
  std::string out = std::string(kind) + " " + std::to_string(columns) + " " + std::to_string(rows);
  for (const double length : lengths) {
    char digits[32];
    const auto end = std::to_chars(digits, digits + sizeof digits, length).ptr;
    out.append(" ").append(digits, end);
  }
  return out;
}

std::string words_of(const Checkerboard& b) {
  return joined("checkerboard", b.columns, b.rows, {b.square_m});
}
std::string words_of(const AprilGrid& b) {
  return joined("aprilgrid", b.columns, b.rows, {b.tag_m, b.spacing});
}
std::string words_of(const CircleGrid& b) {
  return joined("circles", b.columns, b.rows, {b.distance_m, b.diameter_m}) + (b.shifted ? " shifted" : "");
}

std::vector<std::string> split(const std::string& words) {
  std::vector<std::string> out;
  for (std::size_t at = 0; at < words.size();) {
    const std::size_t end = std::min(words.find(' ', at), words.size());
    out.push_back(words.substr(at, end - at));
    at = end + 1;
  }
  return out;
}

}  // namespace

std::string board_words(const Board& board) {
  return std::visit([](const auto& b) { return words_of(b); }, board);
}

std::optional<Board> read_board_words(const std::string& words) {
  const std::vector<std::string> parts = split(words);
  std::vector<double> numbers;
  for (std::size_t i = 1; i < parts.size(); ++i) {
    double value = 0;
    const char* const end = parts[i].data() + parts[i].size();
    const auto read = std::from_chars(parts[i].data(), end, value);
    if (read.ec != std::errc() || read.ptr != end || !std::isfinite(value)) break;
    numbers.push_back(value);
  }
  constexpr double kMost = 1000;
  if (numbers.size() < 3 || numbers[0] < 2 || numbers[1] < 2 || numbers[0] > kMost || numbers[1] > kMost)
    return {};
  const int columns = static_cast<int>(numbers[0]), rows = static_cast<int>(numbers[1]);
  const std::size_t texts = parts.size() - 1 - numbers.size();
  std::optional<Board> out;
  if (parts[0] == "checkerboard" && numbers.size() == 3 && texts == 0)
    out = Checkerboard{columns, rows, numbers[2]};
  if (parts[0] == "aprilgrid" && numbers.size() == 4 && texts == 0)
    out = AprilGrid{columns, rows, numbers[2], numbers[3]};
  const bool shifted = texts == 1 && parts.back() == "shifted";
  if (parts[0] == "circles" && numbers.size() == 4 && (texts == 0 || shifted))
    out = CircleGrid{columns, rows, numbers[2], numbers[3], shifted};
  return out;
}

}  // namespace evpose
