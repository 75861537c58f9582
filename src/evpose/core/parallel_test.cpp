// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/core/parallel.h"

#include <gtest/gtest.h>

#include <cmath>
#include <stdexcept>

namespace evpose {
namespace {

double ordered_sum(int threads) {
  ThreadPool pool(threads);
  const std::size_t n = 100'003;
  std::vector<double> partial(ThreadPool::chunks(n, 97));
  pool.for_chunks(n, 97, [&](std::size_t chunk, std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) partial[chunk] += std::sin(static_cast<double>(i)) * 1e-3;
  });
  double sum = 0;
  for (double p : partial) sum += p;
  return sum;
}

TEST(ThreadPool, OrderedSumIsTheSameForAnyNumberOfThreads) {
  const double one = ordered_sum(1);
  for (int threads : {2, 3, 8}) EXPECT_EQ(one, ordered_sum(threads));
}

TEST(ThreadPool, EveryIndexIsVisitedOnceInManyRounds) {
  ThreadPool pool(4);
  for (std::size_t n : {0, 1, 7, 8, 9, 1000}) {
    for (int round = 0; round < 200; ++round) {
      std::vector<int> visits(n, 0);
      pool.for_chunks(n, 8, [&](std::size_t, std::size_t begin, std::size_t end) {
        for (std::size_t i = begin; i < end; ++i) ++visits[i];
      });
      for (int v : visits) ASSERT_EQ(v, 1);
    }
  }
}

TEST(ThreadPool, ExceptionOfABodyReachesTheCaller) {
  ThreadPool pool(2);
  EXPECT_THROW(pool.for_chunks(100, 10,
                               [](std::size_t chunk, std::size_t, std::size_t) {
                                 if (chunk == 7) throw std::runtime_error("seven");
                               }),
               std::runtime_error);
  int calls = 0;
  pool.for_chunks(1, 10, [&](std::size_t, std::size_t, std::size_t) { ++calls; });
  EXPECT_EQ(calls, 1);
}

}  // namespace
}  // namespace evpose
