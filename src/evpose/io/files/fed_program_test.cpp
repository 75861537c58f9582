// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/io/files/fed_program.h"

#include <gtest/gtest.h>

#include "evpose/io/files/test_files.h"

namespace evpose {
namespace {

std::span<const std::byte> bytes(const std::string& words) { return std::as_bytes(std::span(words)); }

TEST(FedProgram, GetsAllThatIsWritten) {
  const TemporaryFolder folder;
  auto program = FedProgram::start({"sh", "-c", "cat > \"$0\"", folder / "copy"});
  ASSERT_TRUE(program);
  const std::string content(1 << 20, 'x');
  EXPECT_TRUE(program->write(bytes(content)));
  EXPECT_TRUE(program->finish());
  EXPECT_EQ(*read_text_file(folder / "copy", 1 << 24), content);
}

TEST(FedProgram, OneThatIsNotThereIsToBeInstalled) {
  const auto program = FedProgram::start({"no-such-program-at-all"});
  ASSERT_FALSE(program);
  EXPECT_EQ(program.error().line(),
            "no-such-program-at-all: is not installed; install the package no-such-program-at-all");
}

TEST(FedProgram, OneThatEndsEarlyOrBadlyIsAnError) {
  auto early = FedProgram::start({"true"});
  ASSERT_TRUE(early);
  Status status;
  for (int k = 0; k < 1000 && status; ++k) status = early->write(bytes(std::string(1 << 16, 'x')));
  EXPECT_FALSE(status);
  auto bad = FedProgram::start({"sh", "-c", "cat > /dev/null; exit 3"});
  ASSERT_TRUE(bad);
  const Status ended = bad->finish();
  ASSERT_FALSE(ended);
  EXPECT_EQ(ended.error().what, "failed with status 3");
}

}  // namespace
}  // namespace evpose
