// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cstddef>
#include <utility>
#include <vector>

namespace evpose {

/// Sorts by `score`, best first and equals in their order, and keeps at most `most`, none of which is `same`
/// as a better one that is kept.
template <class Guess, class Same>
void keep_different(std::vector<Guess>& guesses, std::size_t most, const Same& same) {
  std::stable_sort(guesses.begin(), guesses.end(),
                   [](const Guess& a, const Guess& b) { return a.score > b.score; });
  std::vector<Guess> out;
  for (const Guess& g : guesses) {
    if (out.size() == most) break;
    if (std::none_of(out.begin(), out.end(), [&](const Guess& better) { return same(better, g); }))
      out.push_back(g);
  }
  guesses = std::move(out);
}

}  // namespace evpose
