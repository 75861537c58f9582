// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include "evpose/core/thinned.h"

namespace evpose {
namespace {

TEST(Thinned, KeepsEveryStrideThAndTheLeastStrideThatFits) {
  for (const std::size_t most : {1U, 2U, 7U, 8U}) {
    Thinned<std::size_t> thinned(most);
    for (std::size_t n = 1; n <= 100; ++n) {
      thinned.add(n - 1);
      const std::size_t stride = thinned.stride();
      EXPECT_EQ(thinned.count(), n);
      ASSERT_EQ(thinned.kept().size(), (n + stride - 1) / stride) << most << " " << n;
      for (std::size_t k = 0; k < thinned.kept().size(); ++k) EXPECT_EQ(thinned.kept()[k], k * stride);
      EXPECT_LE(thinned.kept().size(), most);
      EXPECT_TRUE(stride == 1 || 2 * n > stride * most) << "a smaller stride would do";
    }
  }
}

}  // namespace
}  // namespace evpose
