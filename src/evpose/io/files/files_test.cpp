// SPDX-License-Identifier: BSD-3-Clause
// Files, lines, numbers and settings.
#include <gtest/gtest.h>

#include <csignal>
#include <limits>
#include <vector>

#include "evpose/core/config.h"
#include "evpose/io/files/atomic_file.h"
#include "evpose/io/files/child_process.h"
#include "evpose/io/files/config_yaml.h"
#include "evpose/io/files/input_file.h"
#include "evpose/io/files/numbers.h"
#include "evpose/io/files/row_reader.h"
#include "evpose/io/files/test_files.h"
#include "evpose/io/files/yaml_document.h"

namespace evpose {
namespace {

TEST(AtomicFile, TargetIsTheOldFileUntilCommit) {
  const TemporaryFolder folder;
  const std::string path = folder.file("a", "old");
  auto file = AtomicFile::create(path);
  ASSERT_TRUE(file.ok());
  file->write("new");
  EXPECT_EQ(content_of(path), "old");
  ASSERT_TRUE(file->commit().ok());
  EXPECT_EQ(content_of(path), "new");
  EXPECT_EQ(folder.entries(), 1u);
}

TEST(AtomicFile, WithoutCommitNothingIsLeft) {
  const TemporaryFolder folder;
  {
    auto file = AtomicFile::create(folder / "a");
    ASSERT_TRUE(file.ok());
    file->write("half");
    const auto moved = std::move(*file);
    EXPECT_EQ(folder.entries(), 1u);
  }
  EXPECT_EQ(folder.entries(), 0u);
}

TEST(AtomicFile, SaysWhyItCannotWrite) {
  const TemporaryFolder folder;
  EXPECT_TRUE(says(error_line(write_text_file(folder / "none/a", "")), {"none/a", "No such file"}));
  EXPECT_TRUE(says(error_line(write_text_file(folder.path(), "")), {"is a folder"}));
}

TEST(FirstBytes, TakeNoMoreMemoryThanTheFileHasBytes) {
  const TemporaryFolder folder;
  const std::string path = folder.file("a", "content");
  const auto all = first_bytes(path, std::numeric_limits<std::size_t>::max());
  ASSERT_TRUE(all.ok());
  EXPECT_EQ(*all, "content");
  EXPECT_LT(all->capacity(), 100U);
  EXPECT_EQ(*first_bytes(path, 3), "con");
  EXPECT_EQ(*first_bytes(folder.file("b", ""), 3), "");
}

TEST(LineReader, GivesEveryLineWithItsNumberAndOffset) {
  const TemporaryFolder folder;
  auto lines = LineReader::open(folder.file("a", "one\r\n\nthree\nlast"));
  ASSERT_TRUE(lines.ok());
  std::string_view line;
  std::string all;
  while (lines->next(line).value()) all += text(lines->number(), ":", line, "@", lines->offset(), " ");
  EXPECT_EQ(all, "1:one@5 2:@6 3:three@12 4:last@16 ");
}

TEST(LineReader, CrossesItsBufferAndRefusesEndlessLines) {
  const TemporaryFolder folder;
  std::string content;
  for (int i = 0; i < 100'000; ++i) content += std::to_string(i) + "\n";
  auto lines = LineReader::open(folder.file("a", content));
  std::string_view line;
  std::string again;
  while (lines->next(line).value()) again += std::string(line) + "\n";
  EXPECT_EQ(again, content);
  auto endless = LineReader::open(folder.file("b", "x\n" + std::string(1 << 20, 'y')));
  EXPECT_TRUE(endless->next(line).value());
  EXPECT_TRUE(says(error_line(endless->next(line)), {"b:2", "text file"}));
}

TEST(LineReader, NamesMissingFilesAndFolders) {
  const TemporaryFolder folder;
  EXPECT_TRUE(says(error_line(LineReader::open(folder / "none")), {"none", "no such file"}));
  EXPECT_TRUE(says(error_line(LineReader::open(folder.path())), {"is a folder"}));
}

TEST(Numbers, DecimalTextIsExact) {
  const auto parsed = [](std::string_view s, int decimals) {
    std::int64_t value = -77;
    return parse_decimal(s, decimals, value) ? value : -77;
  };
  EXPECT_EQ(parsed("1700000000.123456789", 9), 1'700'000'000'123'456'789);
  EXPECT_EQ(parsed("0.000779999", 6), 779);
  EXPECT_EQ(parsed("-0.000000001", 6), -1);
  EXPECT_EQ(parsed("-1.5", 3), -1500);
  EXPECT_EQ(parsed("+2", 0), 2);
  EXPECT_EQ(parsed(".5", 1), 5);
  EXPECT_EQ(parsed("5.", 1), 50);
  EXPECT_EQ(parsed("1.64266e+09", 6), 1'642'660'000'000'000);
  EXPECT_EQ(parsed("12e-1", 0), 1);
  EXPECT_EQ(parsed("1234", -3), 1);
  for (const char* bad :
       {"", "-", ".", "1x", "x", "1.2.3", "1e", "1e9999", "--1", "nan", "inf", "1 2", "99999999999"})
    EXPECT_EQ(parsed(bad, 9), -77) << bad;
}

TEST(Numbers, FormattedDecimalsReadBack) {
  for (const std::int64_t v : {std::int64_t{0}, std::int64_t{1}, std::int64_t{-1},
                               std::int64_t{-1'500'000'000}, std::int64_t{1'700'000'000'123'456'789}}) {
    std::int64_t again = 0;
    EXPECT_TRUE(parse_decimal(format_decimal(v, 9), 9, again));
    EXPECT_EQ(again, v) << format_decimal(v, 9);
  }
  EXPECT_EQ(format_decimal(-1500, 3), "-1.500");
  EXPECT_EQ(format_decimal(std::numeric_limits<std::int64_t>::min(), 0), "-9223372036854775808");
}

TEST(Numbers, FieldsByBlanksOrCommas) {
  std::vector<std::string_view> f;
  split_fields("  a\tb  c ", f);
  EXPECT_EQ(f, (std::vector<std::string_view>{"a", "b", "c"}));
  split_fields("a, b,,c", f);
  EXPECT_EQ(f, (std::vector<std::string_view>{"a", "b", "", "c"}));
  split_fields("a,", f);
  EXPECT_EQ(f, (std::vector<std::string_view>{"a", ""}));
  split_fields("", f);
  EXPECT_TRUE(f.empty());
}

TEST(RowReader, GivesFieldsAndCommentsOfEachRowWithItsLine) {
  const TemporaryFolder folder;
  auto rows = RowReader::open(folder.file("a", "# t x\n\n 1 2.5\t3 \n4, 5\n\n#end\n"));
  ASSERT_TRUE(rows.ok());
  ASSERT_TRUE(rows->next().value());
  EXPECT_EQ(rows->fields(), (std::vector<std::string_view>{"1", "2.5", "3"}));
  EXPECT_EQ(rows->line(), "1 2.5\t3");
  EXPECT_EQ(rows->comments(), std::vector<std::string>{" t x"});
  EXPECT_TRUE(says(rows->where(), {"a:3"}));
  std::vector<double> values(2);
  EXPECT_TRUE(rows->numbers(1, values, "").ok());
  EXPECT_EQ(values, (std::vector<double>{2.5, 3}));
  ASSERT_TRUE(rows->next().value());
  EXPECT_EQ(rows->fields(), (std::vector<std::string_view>{"4", "5"}));
  EXPECT_TRUE(rows->comments().empty());
  EXPECT_FALSE(rows->next().value());
}

TEST(RowReader, NumbersThatAreNotFiniteAreNamedWithTheirLine) {
  const TemporaryFolder folder;
  for (const char* bad : {"nan", "inf", "1x", "-"}) {
    auto rows = RowReader::open(folder.file("a", text("0 0\n0 ", bad, "\n")));
    ASSERT_TRUE(rows->next().value());
    ASSERT_TRUE(rows->next().value());
    std::vector<double> values(2);
    EXPECT_TRUE(says(error_line(rows->numbers(0, values, "two numbers")), {"a:2", bad, "two numbers"}));
  }
}

struct Settings {
  double rate_hz = 1;
  struct Inner {
    int count = 1;
  } inner;
};
void describe(ConfigTable& table, Settings::Inner& c) {
  table.add("count", c.count, "", "how many", {0, 10});
}
void describe(ConfigTable& table, Settings& c) {
  table.add("rate_hz", c.rate_hz, "Hz", "rate", {0, 100});
  table.group("inner", c.inner);
}

TEST(ConfigYaml, NestedAndDottedKeysAreTheSame) {
  const TemporaryFolder folder;
  Settings s;
  ConfigTable table;
  describe(table, s);
  ASSERT_TRUE(apply_yaml(table, folder.file("a.yaml", "rate_hz: 5\ninner:\n  count: 3\n")).ok());
  EXPECT_EQ(s.rate_hz, 5);
  EXPECT_EQ(s.inner.count, 3);
  ASSERT_TRUE(apply_yaml(table, folder.file("b.yaml", "inner.count: 4\n")).ok());
  EXPECT_EQ(s.inner.count, 4);
  ASSERT_TRUE(apply_yaml(table, folder.file("c.yaml", table.to_yaml())).ok());
  EXPECT_EQ(s.inner.count, 4);
  EXPECT_TRUE(apply_yaml(table, folder.file("d.yaml", "# nothing\n")).ok());
}

TEST(ConfigYaml, ErrorsNameFileAndLine) {
  const TemporaryFolder folder;
  Settings s;
  ConfigTable table;
  describe(table, s);
  const auto line = [&](const char* content) {
    return error_line(apply_yaml(table, folder.file("a.yaml", content)));
  };
  EXPECT_TRUE(says(line("rate_hz: 5\ninner:\n  cout: 3\n"), {"a.yaml:3", "inner.cout", "inner.count"}));
  EXPECT_TRUE(says(line("\nrate_hz: fast\n"), {"a.yaml:2", "rate_hz", "fast"}));
  EXPECT_TRUE(says(line("rate_hz: [1, 2]\n"), {"a.yaml:1", "list"}));
  EXPECT_TRUE(says(line("rate_hz: 1\nrate_hz: 2\n"), {"a.yaml:2", "twice"}));
  EXPECT_TRUE(says(line("rate_hz: [1\n"), {"a.yaml:", "YAML"}));
  EXPECT_TRUE(says(line("- 1\n"), {"a.yaml:1"}));
  EXPECT_TRUE(says(error_line(apply_yaml(table, folder / "none.yaml")), {"none.yaml", "no such file"}));
}

TEST(ConfigYaml, Assignment) {
  Settings s;
  ConfigTable table;
  describe(table, s);
  EXPECT_TRUE(apply_assignment(table, "inner.count=7").ok());
  EXPECT_EQ(s.inner.count, 7);
  EXPECT_TRUE(says(error_line(apply_assignment(table, "inner.count")), {"--set", "key=value"}));
  EXPECT_TRUE(says(error_line(apply_assignment(table, "rate=3")), {"--set", "rate_hz"}));
}

TEST(YamlDocument, AliasesCannotFillTheMemory) {
  const TemporaryFolder folder;
  std::string bomb = "a0: &a0 [x,x,x,x,x,x,x,x,x,x]\n";
  for (int i = 1; i < 12; ++i) {
    const std::string before = "*a" + std::to_string(i - 1);
    bomb += text("a", i, ": &a", i, " [", before);
    for (int k = 1; k < 10; ++k) bomb += "," + before;
    bomb += "]\n";
  }
  EXPECT_TRUE(says(error_line(YamlDocument::read(folder.file("a.yaml", bomb))), {"a.yaml:", "values"}));
}

TEST(YamlDocument, AnyBytesAreAnsweredInOneLine) {
  const TemporaryFolder folder;
  unsigned seed = 1;
  for (int i = 0; i < 300; ++i) {
    std::string content;
    for (int k = 0; k < 40; ++k) {
      seed = seed * 1664525 + 1013904223;
      content += "[]{}:-,&*!|>'\"%@ \n\tab01#?"[seed >> 24 & 0x1F % 26];
    }
    const std::string path = folder.file("a.yaml", content);
    expect_no_harm(YamlDocument::read(path), path, static_cast<std::size_t>(i));
  }
}

TEST(ChildProcess, TellsWhatItLivedThrough) {
  const std::string sound = "a.h5";
  EXPECT_TRUE(child_survives([](const std::string& path) { return path == "a.h5"; }, sound));
  EXPECT_FALSE(child_survives([](const std::string& path) { return path != "a.h5"; }, sound));
  EXPECT_FALSE(child_survives(
      [](const std::string&) -> bool {
        ::raise(SIGSEGV);
        return true;
      },
      sound));
  EXPECT_FALSE(child_survives(
      [](const std::string&) -> bool {
        ::raise(SIGABRT);
        return true;
      },
      sound));
  EXPECT_FALSE(child_survives(
      [](const std::string&) { return std::vector<char>(std::size_t{3} << 30, 'x').back() == 'x'; }, sound));
}

}  // namespace
}  // namespace evpose
