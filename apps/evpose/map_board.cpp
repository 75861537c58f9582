// SPDX-License-Identifier: BSD-3-Clause
#include <CLI/CLI.hpp>
#include <charconv>
#include <cstdio>
#include <memory>
#include <optional>

#include "commands.h"
#include "evpose/io/maps/map_h5.h"
#include "evpose/map_build/board_map.h"

namespace evpose {
namespace {

struct BoardOptions {
  std::string checkerboard, aprilgrid, circles, output = "board.h5";
  double square_m = 0, tag_m = 0, spacing = 0.3, distance_m = 0, diameter_m = 0;
  bool shifted = false;
};

struct Counts {
  int columns = 0, rows = 0;
};

/// "9x7".
std::optional<Counts> counts_of(const std::string& words) {
  Counts out;
  const char *at = words.data(), *const end = at + words.size();
  const auto columns = std::from_chars(at, end, out.columns);
  if (columns.ec != std::errc() || columns.ptr == end || *columns.ptr != 'x') return {};
  const auto rows = std::from_chars(columns.ptr + 1, end, out.rows);
  return rows.ec == std::errc() && rows.ptr == end ? std::optional(out) : std::nullopt;
}

Expected<Board> board_of(const BoardOptions& o) {
  const std::pair<const char*, const std::string*> kinds[] = {
      {"--checkerboard", &o.checkerboard}, {"--aprilgrid", &o.aprilgrid}, {"--circles", &o.circles}};
  const char* kind = nullptr;
  Counts counts;
  for (const auto& [name, words] : kinds) {
    if (words->empty()) continue;
    if (kind != nullptr) return Error{name, text("and ", kind, " are two boards"), "give one"};
    kind = name;
    const auto read = counts_of(*words);
    if (!read) return Error{name, "'" + *words + "' is no size", "give COLUMNSxROWS, e.g. 9x7"};
    counts = *read;
  }
  if (kind == nullptr)
    return Error{"map board", "no board is given", "give --checkerboard, --aprilgrid or --circles"};
  const auto [columns, rows] = counts;
  if (kind == kinds[0].first) return Board(Checkerboard{columns, rows, o.square_m});
  if (kind == kinds[1].first) return Board(AprilGrid{columns, rows, o.tag_m, o.spacing});
  return Board(CircleGrid{columns, rows, o.distance_m, o.diameter_m, o.shifted});
}

int make_board(const BoardOptions& o) {
  const auto board = board_of(o);
  if (!board) return bad_input(board.error());
  const auto map = board_map(*board);
  if (!map) return bad_input(map.error());
  if (const auto ok = write_map_h5(o.output, *map); !ok) return bad_input(ok.error());
  std::printf("%s: %zu points; origin in the middle, x to the right, y into the board, z up\n",
              o.output.c_str(), map->points.size());
  if (const std::string turned = board_symmetry(*board); !turned.empty())
    std::printf("the board looks the same when %s: poses may be turned so, intrinsics are not affected\n",
                turned.c_str());
  return 0;
}

}  // namespace

void add_map_board(CLI::App& map, std::function<int()>& run) {
  auto o = std::make_shared<BoardOptions>();
  auto* board = map.add_subcommand("board", "Make the map of a printed calibration board");
  board->add_option(
      "--checkerboard", o->checkerboard,
      "COLUMNSxROWS of squares (not of the corners between them); the one at the lower left is dark");
  board->add_option("--square", o->square_m, "side of a square, m");
  board->add_option("--aprilgrid", o->aprilgrid, "COLUMNSxROWS of tags, as Kalibr prints them");
  board->add_option("--tag", o->tag_m, "side of a tag, m");
  board->add_option("--spacing", o->spacing, "distance between tags as a share of that")
      ->capture_default_str();
  board->add_option("--circles", o->circles, "COLUMNSxROWS of dark discs");
  board->add_option("--distance", o->distance_m, "of rows, and of discs in a row (shifted: half of it), m");
  board->add_option("--diameter", o->diameter_m, "of a disc, m");
  board->add_flag("--shifted", o->shifted, "every second row by half a distance (OpenCV's asymmetric grid)");
  board->add_option("-o,--output", o->output, "map file")->capture_default_str();
  board->callback([o, &run] { run = [o] { return make_board(*o); }; });
}

}  // namespace evpose
