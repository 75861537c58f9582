// SPDX-License-Identifier: BSD-3-Clause
// Files of other makers' cameras and tools, of the shared data, against the answers that stand beside them.
#include <gtest/gtest.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <map>
#include <nlohmann/json.hpp>

#include "evpose/core/log.h"
#include "evpose/io/events/test_columns.h"
#include "evpose/io/files/test_files.h"
#include "evpose/io/formats/open_events.h"

namespace evpose {
namespace {

using Json = nlohmann::json;

std::string formats_folder() { return shared_folder() + "/data/real/formats/"; }

Json answers_of(const std::string& name) {
  return Json::parse(content_of(formats_folder() + "known_answers.json")).at(name);
}

struct Columns : EventColumns {
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
  auto columns = read_columns(**reader);
  if (columns)
    static_cast<EventColumns&>(c) = *std::move(columns);
  else
    c.error = columns.error().line();
  return c;
}

struct File {
  const char* name;
  ImageSize size;
  bool rows_from_bottom = false;  ///< the answers have the rows as the file has them
};

class KnownEvents : public ::testing::TestWithParam<File> {};

TEST_P(KnownEvents, EveryColumnIsTheKnownOne) {
  const auto& [name, size, rows_from_bottom] = GetParam();
  EVPOSE_NEEDS_SHARED(formats_folder());
  const Json known = answers_of(name);
  EventReadOptions options;
  options.flip_y = rows_from_bottom;
  const Columns c = read_columns(name, options);
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
                                           File{"ncars_sample_dat_v2.dat", {}},
                                           File{"dvxplorer_events_imu.aedat4", {320, 240}},
                                           File{"davis346_events_frames_imu_triggers.aedat4", {346, 260}},
                                           File{"davis346_no_table_cut.aedat4", {346, 260}},
                                           File{"aedat2_davis240c_events_imu_cut.aedat", {240, 180}, true},
                                           File{"event_stream_dvs_cut.es", {320, 240}},
                                           File{"event_stream_dvs_trcl0.es", {30, 32}},
                                           File{"nmnist_sample.bin", {}},
                                           File{"ncaltech101_faces_easy_0001.bin", {}}),
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

struct Sensors {
  std::vector<ImuSample> imu;
  std::vector<Trigger> triggers;
  std::vector<GreyFrame> frames;
};

Sensors read_all_sensors(const std::string& name) {
  Sensors s;
  SensorSink sink;
  sink.imu = [&](const ImuSample& sample) { s.imu.push_back(sample); };
  sink.trigger = [&](const Trigger& trigger) { s.triggers.push_back(trigger); };
  sink.frame = [&](const GreyFrame& frame) { s.frames.push_back(frame); };
  const auto status = read_sensors(formats_folder() + name, "", sink);
  EXPECT_TRUE(status.ok()) << (status ? "" : status.error().line());
  return s;
}

/// A row of the answers: temperature, acceleration, rate, ...; `accel` and `gyro` are SI per unit of the
/// file.
void expect_imu(const Json& row, const ImuSample& sample, double accel, double gyro) {
  for (int i = 0; i < 3; ++i) {
    EXPECT_NEAR(sample.accel[i], row[static_cast<std::size_t>(1 + i)].get<double>() * accel, 1e-6);
    EXPECT_NEAR(sample.gyro[i], row[static_cast<std::size_t>(4 + i)].get<double>() * gyro, 1e-6);
  }
}

ImuSample mean_of(const std::vector<ImuSample>& samples) {
  ImuSample mean;
  for (const ImuSample& s : samples) {
    mean.accel += s.accel / static_cast<double>(samples.size());
    mean.gyro += s.gyro / static_cast<double>(samples.size());
  }
  return mean;
}

class KnownSensors : public ::testing::TestWithParam<const char*> {};

TEST_P(KnownSensors, ImuTriggersAndFramesAreTheKnownOnes) {
  EVPOSE_NEEDS_SHARED(formats_folder());
  const Json known = answers_of(GetParam());
  const Sensors s = read_all_sensors(GetParam());
  const double degree = std::acos(-1.0) / 180;
  ASSERT_EQ(s.imu.size(), known["imu_samples"].get<std::size_t>());
  EXPECT_EQ(s.imu.front().t, known["imu_t_first"].get<std::int64_t>() * kNsPerUs);
  EXPECT_EQ(s.imu.back().t, known["imu_t_last"].get<std::int64_t>() * kNsPerUs);
  expect_imu(known["imu_first"], s.imu.front(), 9.80665, degree);
  expect_imu(known["imu_mean"], mean_of(s.imu), 9.80665, degree);
  EXPECT_EQ(s.triggers.size(), known["triggers"].get<std::size_t>());
  std::map<std::string, int> kinds;
  std::int64_t sum_t_us = 0;
  for (const Trigger& trigger : s.triggers) {
    ++kinds[std::to_string(trigger.id)];
    sum_t_us += trigger.t / kNsPerUs;
  }
  EXPECT_EQ(Json(kinds), known["trigger_types"].empty() ? Json(kinds) : known["trigger_types"]);
  EXPECT_EQ(sum_t_us, known["trigger_sum_t"].get<std::int64_t>());
  ASSERT_EQ(s.frames.size(), known["frames"].get<std::size_t>());
  for (std::size_t i = 0; i < s.frames.size(); ++i) {
    const GreyFrame& frame = s.frames[i];
    const Json& answer = known["frame_list"][i];
    EXPECT_EQ(digest(frame.pixels), answer["sha3_224"].get<std::string>()) << i;
    EXPECT_EQ(frame.width, answer["width"].get<int>());
    EXPECT_EQ(frame.height, answer["height"].get<int>());
    const auto begin = answer["exposure_start"].get<std::int64_t>(),
               end = answer["exposure_end"].get<std::int64_t>();
    EXPECT_EQ(frame.t, (begin + end) * kNsPerUs / 2) << i;
  }
  std::map<std::string, std::int64_t> packets;
  const auto streams = list_streams(formats_folder() + GetParam());
  for (const StreamInfo& stream : *streams)
    if (stream.messages > 0) packets[stream.name] = stream.messages;
  EXPECT_EQ(Json(packets), known["packets"]);
}

INSTANTIATE_TEST_SUITE_P(Aedat4, KnownSensors,
                         ::testing::Values("dvxplorer_events_imu.aedat4",
                                           "davis346_events_frames_imu_triggers.aedat4",
                                           "davis346_no_table_cut.aedat4"),
                         [](const auto& file) {
                           const std::string name = file.param;
                           return name.substr(0, name.find('.'));
                         });

TEST(KnownStreams, Aedat2) {
  const std::string name = "aedat2_davis240c_events_imu_cut.aedat";
  EVPOSE_NEEDS_SHARED(formats_folder());
  const Json known = answers_of(name);
  const Sensors s = read_all_sensors(name);
  ASSERT_EQ(s.imu.size(), known["imu_samples"].get<std::size_t>());
  EXPECT_EQ(s.imu.front().t, known["imu_t_first"].get<std::int64_t>() * kNsPerUs);
  EXPECT_EQ(s.imu.back().t, known["imu_t_last"].get<std::int64_t>() * kNsPerUs);
  // The header says 8 g and 1000 deg/s.
  const auto in_order = [](const Json& row) {
    return Json({0, row[0], row[1], row[2], row[4], row[5], row[6]});
  };
  const double accel = 8.0 / 32768 * 9.80665, gyro = 1000.0 / 32768 * std::acos(-1.0) / 180;
  expect_imu(in_order(known["imu_first"]), s.imu.front(), accel, gyro);
  expect_imu(in_order(known["imu_mean"]), mean_of(s.imu), accel, gyro);
  EXPECT_NEAR(mean_of(s.imu).accel.norm(), 9.8, 0.5);
  EXPECT_TRUE(s.triggers.empty());
}

TEST(KnownStreams, GenericEventStreamIsCounted) {
  const std::string name = "event_stream_generic.es";
  EVPOSE_NEEDS_SHARED(formats_folder());
  const auto streams = list_streams(formats_folder() + name);
  ASSERT_TRUE(streams.ok() && streams->size() == 1) << error_line(streams);
  EXPECT_EQ(streams->front().messages, answers_of(name)["events"].get<std::int64_t>());
  EXPECT_TRUE(says(read_columns(name).error, {"generic", "no events"}));
}

TEST(KnownStreams, RawFilesWithoutTriggers) {
  EVPOSE_NEEDS_SHARED(formats_folder());
  EXPECT_TRUE(read_all_sensors("prophesee_evt3_gen41.raw").triggers.empty());
  const auto streams = list_streams(formats_folder() + "prophesee_evt2_gen3.raw");
  EXPECT_EQ(streams->front().type, "EVT2");
}

class CutFiles : public ::testing::TestWithParam<const char*> {};

/// Events of a cut file are the first of the whole one, or there is an error that names the file.
TEST_P(CutFiles, AreReadAsFarAsTheyGoOrRefused) {
  EVPOSE_NEEDS_SHARED(formats_folder());
  const std::string whole = content_of(formats_folder() + GetParam());
  const Columns all = read_columns(GetParam());
  const TemporaryFolder folder;
  const std::size_t step = whole.size() < 2000 ? 1 : whole.size() / 150 + 1;
  set_log_level(LogLevel::quiet);
  std::size_t longest = 0;
  for (std::size_t n = 0; n < whole.size(); n += step) {
    const std::string path = folder.file(GetParam(), whole.substr(0, n));
    const auto reader = open_events(path, "", {});
    if (!reader) {
      expect_no_harm(reader, path, n);
      continue;
    }
    EventPacket packet;
    std::size_t count = 0;
    bool failed = false;
    while (true) {
      const auto more = (*reader)->next(packet);
      if (!more) expect_no_harm(more, path, n);
      failed = !more;
      if (!more || !*more) break;
      for (const Event& e : packet.events) {
        ASSERT_LT(count, all.x.size()) << n;
        ASSERT_TRUE(e.x == all.x[count] && e.y == all.y[count] && e.on == all.p[count]) << n;
        ASSERT_EQ(static_cast<std::uint64_t>(packet.time(e) / kNsPerUs), all.t_us[count]) << n;
        ++count;
      }
    }
    if (failed) continue;
    EXPECT_GE(count, longest) << n;
    longest = count;
  }
  set_log_level(LogLevel::normal);
  EXPECT_GT(longest, 0u);
}

INSTANTIATE_TEST_SUITE_P(Files, CutFiles,
                         ::testing::Values("evt21_pattern_vector_little.raw",
                                           "evt21_pattern_time_loop_legacy.raw",
                                           "prophesee_evt2_gen3_cut.raw", "prophesee_evt3_gen41.raw",
                                           "ncars_sample_dat_v2.dat", "dvxplorer_events_imu.aedat4",
                                           "davis346_no_table_cut.aedat4", "event_stream_dvs_trcl0.es",
                                           "aedat2_davis240c_events_imu_cut.aedat", "simple_raw_events.txt"),
                         [](const auto& file) {
                           std::string name = file.param;
                           std::replace_if(
                               name.begin(), name.end(), [](unsigned char c) { return std::isalnum(c) == 0; },
                               '_');
                           return name;
                         });

}  // namespace
}  // namespace evpose
