// SPDX-License-Identifier: BSD-3-Clause
// Files of other makers' cameras and tools, of the shared data, against the answers that stand beside them.
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "evpose/io/event_reader.h"
#include "evpose/io/sensor_streams.h"
#include "evpose/io/test_files.h"
#include "evpose/io/test_sha3.h"

namespace evpose {
namespace {

using Json = nlohmann::json;

std::string formats_folder() { return shared_folder() + "/data/real/formats/"; }

Json answers_of(const std::string& name) {
  return Json::parse(content_of(formats_folder() + "known_answers.json")).at(name);
}

/// The columns of a file as the answers have them.
struct Columns {
  std::vector<std::uint64_t> t_us;
  std::vector<std::uint16_t> x, y;
  std::vector<std::uint8_t> p;
  std::string error;
  ImageSize size;
  EventExtent extent;
};

Columns read_columns(const std::string& name, const EventReadOptions& options = {}) {
  Columns c;
  const auto reader = open_events(formats_folder() + name, "", options);
  if (!reader) {
    c.error = reader.error().line();
    return c;
  }
  c.size = (*reader)->size();
  c.extent = (*reader)->extent();
  EventPacket packet;
  while (true) {
    const auto more = (*reader)->next(packet);
    if (!more) c.error = more.error().line();
    if (!more || !*more) return c;
    for (const Event& e : packet.events) {
      c.t_us.push_back(static_cast<std::uint64_t>(packet.time(e) / kNsPerUs));
      c.x.push_back(e.x);
      c.y.push_back(e.y);
      c.p.push_back(e.on);
    }
  }
}

template <class T>
std::string digest(const std::vector<T>& column) {
  return sha3_224(std::as_bytes(std::span(column)));
}

template <class T>
std::uint64_t sum(const std::vector<T>& column) {
  std::uint64_t total = 0;
  for (const T value : column) total += value;
  return total;
}

struct File {
  const char* name;
  ImageSize size;
};

class KnownEvents : public ::testing::TestWithParam<File> {};

TEST_P(KnownEvents, EveryColumnIsTheKnownOne) {
  const auto& [name, size] = GetParam();
  EVPOSE_NEEDS_SHARED(formats_folder());
  const Json known = answers_of(name);
  const Columns c = read_columns(name);
  ASSERT_EQ(c.error, "");
  EXPECT_EQ(c.size, size);
  EXPECT_EQ(c.t_us.size(), known["events"].get<std::size_t>());
  EXPECT_EQ(c.extent.first_ns, known["t_first"].get<std::int64_t>() * kNsPerUs);
  EXPECT_EQ(c.extent.last_ns, known["t_last"].get<std::int64_t>() * kNsPerUs);
  EXPECT_EQ(c.extent.count, known["events"].get<std::int64_t>());
  EXPECT_EQ(sum(c.x), known["sum_x"].get<std::uint64_t>());
  EXPECT_EQ(sum(c.p), known["on"].get<std::uint64_t>());
  const Json& hashes = known["sha3_224"];
  EXPECT_EQ(digest(c.t_us), hashes["t"].get<std::string>());
  EXPECT_EQ(digest(c.x), hashes["x"].get<std::string>());
  EXPECT_EQ(digest(c.y), hashes[hashes.contains("y_from_top") ? "y_from_top" : "y"].get<std::string>());
  EXPECT_EQ(digest(c.p), hashes["p"].get<std::string>());
}

std::string test_name(const ::testing::TestParamInfo<File>& info) {
  std::string name = info.param.name;
  for (char& c : name)
    if (std::isalnum(static_cast<unsigned char>(c)) == 0) c = '_';
  return name;
}

INSTANTIATE_TEST_SUITE_P(Files, KnownEvents,
                         ::testing::Values(File{"prophesee_evt2_gen3.raw", {640, 480}},
                                           File{"prophesee_evt2_gen3_cut.raw", {640, 480}},
                                           File{"prophesee_evt3_gen41.raw", {1280, 720}},
                                           File{"ncars_sample_dat_v2.dat", {}}),
                         test_name);

class KnownRows : public ::testing::TestWithParam<const char*> {};

TEST_P(KnownRows, EveryRowIsTheKnownOne) {
  const std::string name = std::string("evt21_pattern_") + GetParam() + ".raw";
  EVPOSE_NEEDS_SHARED(formats_folder());
  const Json rows = answers_of(name)["rows_t_x_y_p"];
  const Columns c = read_columns(name);
  ASSERT_EQ(c.error, "");
  ASSERT_EQ(c.t_us.size(), rows.size());
  for (std::size_t i = 0; i < rows.size(); ++i)
    EXPECT_EQ(Json({c.t_us[i], c.x[i], c.y[i], c.p[i]}), rows[i]) << i;
}

INSTANTIATE_TEST_SUITE_P(Evt21, KnownRows,
                         ::testing::Values("basic_little", "basic_legacy", "before_time_high_little",
                                           "before_time_high_legacy", "vector_little", "vector_legacy",
                                           "timestamps_little", "timestamps_legacy", "time_loop_little",
                                           "time_loop_legacy", "time_bit31_little", "time_bit31_legacy"),
                         [](const auto& file) { return std::string(file.param); });

}  // namespace
}  // namespace evpose
