// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/io/motion/dataflash.h"

#include <gtest/gtest.h>

#include <map>
#include <nlohmann/json.hpp>
#include <numbers>

#include "evpose/io/files/test_files.h"

namespace evpose {
namespace {

using Json = nlohmann::json;

std::string sample(const std::string& name) { return shared_folder() + "/data/real/formats/" + name; }

std::string bytes_of(const auto& value) { return {reinterpret_cast<const char*>(&value), sizeof value}; }

std::string padded(const std::string& s, std::size_t size) { return s + std::string(size - s.size(), '\0'); }

std::string record(int type, const std::string& body) {
  return std::string("\xA3\x95") + static_cast<char>(type) + body;
}

std::string format_record(int type, int body, const char* name, const char* formats, const char* labels) {
  return record(0x80, std::string{static_cast<char>(type), static_cast<char>(body + 3)} + padded(name, 4) +
                          padded(formats, 16) + padded(labels, 64));
}

std::string imu_body(std::uint64_t t_us, float gyro_x, float accel_z) {
  std::string out = bytes_of(t_us);
  for (const float v : {gyro_x, 0.f, 0.f, 0.f, 0.f, accel_z}) out += bytes_of(v);
  return out;
}

constexpr const char* kImuLabels = "TimeUS,GyrX,GyrY,GyrZ,AccX,AccY,AccZ";

std::vector<ImuSample> imu_of(const std::string& path, const std::string& name = "") {
  std::vector<ImuSample> out;
  SensorSink sink;
  sink.imu = [&](const ImuSample& s) { out.push_back(s); };
  const auto status = read_dataflash_sensors(path, name, sink);
  EXPECT_TRUE(status.ok()) << error_line(status);
  return out;
}

TEST(DataFlash, UnitsAndMultipliersOfTheLogAreApplied) {
  const TemporaryFolder folder;
  const std::string log = format_record(0x80, 86, "FMT", "BBnNZ", "Type,Length,Name,Format,Columns") +
                          format_record(10, 73, "UNIT", "QbZ", "TimeUS,Id,Label") +
                          format_record(11, 17, "MULT", "Qbd", "TimeUS,Id,Mult") +
                          format_record(12, 41, "FMTU", "QBNN", "TimeUS,FmtType,UnitIds,MultIds") +
                          format_record(13, 32, "IMU", "Qffffff", kImuLabels) +
                          format_record(14, 12, "X", "Qcc", "TimeUS,A,B");
  EXPECT_TRUE(starts_as_dataflash(log));
  std::string units = record(10, bytes_of(std::uint64_t{1}) + "k" + padded("deg/s", 64));
  units += record(11, bytes_of(std::uint64_t{1}) + "C" + bytes_of(0.5));
  units += record(12, bytes_of(std::uint64_t{1}) + "\x0D" + padded("skkkooo", 16) + padded("F------", 16));
  units += record(12, bytes_of(std::uint64_t{1}) + "\x0E" + padded("s--", 16) + padded("F-C", 16));
  const auto path =
      folder.file("log.bin", log + units + record(13, imu_body(1'000'001, 90.f, -9.5f)) +
                                 record(14, bytes_of(std::uint64_t{7}) + bytes_of(std::int16_t{-250}) +
                                                bytes_of(std::int16_t{-250})));
  const auto imu = imu_of(path);
  ASSERT_EQ(imu.size(), 1u);
  EXPECT_EQ(imu[0].t, 1'000'001'000);
  EXPECT_NEAR(imu[0].gyro.x(), std::numbers::pi / 2, 1e-12);
  EXPECT_EQ(imu[0].accel.z(), -9.5);
  auto reader = DataFlashReader::open(path);
  ASSERT_TRUE(reader.ok());
  DataFlashRecord last, next;
  while (reader->next(next)) last = next;
  ASSERT_EQ(last.type->name, "X");
  // c is hundredths, unless the log gives a multiplier for the stored number.
  EXPECT_EQ(last.number(*last.type->find("A")), -2.5);
  EXPECT_EQ(last.number(*last.type->find("B")), -125);
}

TEST(DataFlash, NumberedSensorsAreStreamsOfTheirOwn) {
  const TemporaryFolder folder;
  std::string log = format_record(13, 33, "IMU", "QBffffff", "TimeUS,I,GyrX,GyrY,GyrZ,AccX,AccY,AccZ");
  for (int i = 0; i < 6; ++i) {
    std::string body = imu_body(static_cast<std::uint64_t>(100 + i), 0.f, static_cast<float>(-i));
    body.insert(8, 1, static_cast<char>(i % 2));
    log += record(13, body);
  }
  const auto path = folder.file("log.bin", log);
  const auto first = imu_of(path), second = imu_of(path, "IMU[1]");
  ASSERT_EQ(first.size(), 3u);
  ASSERT_EQ(second.size(), 3u);
  EXPECT_EQ(first[1].accel.z(), -2);
  EXPECT_EQ(second[1].accel.z(), -3);
  SensorSink sink;
  sink.imu = [](const ImuSample&) {};
  EXPECT_TRUE(says(error_line(read_dataflash_sensors(path, "IMU[2]", sink)), {"log.bin", "IMU[2]"}));
}

TEST(DataFlash, OnlyTheFormatTypeDescribesWhateverOthersAreCalled) {
  const TemporaryFolder folder;
  const std::string posing = std::string("\x0D\x05", 2) + padded("IMU", 4) + "BB";  // type 13, two bytes
  const auto imu =
      imu_of(folder.file("log.bin", format_record(20, 8, "FMT", "Q", "TimeUS") + record(20, posing) +
                                        format_record(13, 32, "IMU", "Qffffff", kImuLabels) +
                                        record(13, imu_body(5, 1.f, -9.f))));
  ASSERT_EQ(imu.size(), 1u);
  EXPECT_EQ(imu[0].accel.z(), -9);
}

TEST(DataFlash, BytesThatAreNoRecordArePassedOver) {
  const TemporaryFolder folder;
  const std::string head = format_record(13, 32, "IMU", "Qffffff", kImuLabels);
  const std::string good = record(13, imu_body(5, 0.f, -9.f));
  const auto path = folder.file("log.bin", head + good + "\xA3\x95\x77noise" + good + good.substr(0, 20));
  EXPECT_EQ(imu_of(path).size(), 2u);
  auto reader = DataFlashReader::open(path);
  DataFlashRecord next;
  while (reader->next(next)) continue;
  EXPECT_EQ(reader->unused_bytes(), 8 + 20);
}

class KnownLog : public ::testing::TestWithParam<const char*> {};

TEST_P(KnownLog, RecordsAndSamplesAreTheKnownOnes) {
  EVPOSE_NEEDS_SHARED(sample(GetParam()));
  const std::string path = sample(GetParam());
  const Json known = Json::parse(content_of(sample("known_answers.json"))).at(GetParam());
  auto reader = DataFlashReader::open(path);
  ASSERT_TRUE(reader.ok()) << error_line(reader);
  std::map<std::string, int> counts;
  int all = 0;
  for (DataFlashRecord r; reader->next(r); ++all) ++counts[r.type->name];
  EXPECT_EQ(all, known["messages"].get<int>());
  EXPECT_EQ(Json(counts), known["count_by_name"]);
  EXPECT_EQ(reader->unused_bytes(), known["bytes_not_used"].get<std::int64_t>());

  for (const std::string name : {"IMU", "IMU2"}) {
    const auto imu = imu_of(path, name);
    ASSERT_EQ(imu.size(), known["count_by_name"][name].get<std::size_t>());
    const auto expect_row = [&](const ImuSample& s, const Json& row) {
      EXPECT_EQ(s.t, row.value("TimeUS", std::int64_t{0}) * kNsPerUs);
      for (int k = 0; k < 3; ++k) {
        EXPECT_NEAR(s.gyro[k], row[std::string("Gyr") + "XYZ"[k]].get<double>(), 1e-12);
        EXPECT_NEAR(s.accel[k], row[std::string("Acc") + "XYZ"[k]].get<double>(), 1e-12);
      }
    };
    expect_row(imu.front(), known[name]["first"]);
    expect_row(imu.back(), known[name]["last"]);
    ImuSample mean;
    for (const ImuSample& s : imu) {
      mean.gyro += s.gyro / static_cast<double>(imu.size());
      mean.accel += s.accel / static_cast<double>(imu.size());
    }
    expect_row(mean, known[name]["mean"]);
  }
}

TEST_P(KnownLog, EndsInOrderWhereverItIsCut) {
  EVPOSE_NEEDS_SHARED(sample(GetParam()));
  const std::string whole = content_of(sample(GetParam())).substr(0, 65536);
  const TemporaryFolder folder;
  std::int64_t before = 0;
  for (std::size_t length = 0; length < whole.size(); length += 97) {
    const std::string path = folder.file("cut.bin", std::string_view(whole).substr(0, length));
    const auto streams = list_dataflash_streams(path);
    if (!streams) continue;
    std::int64_t all = 0;
    for (const StreamInfo& s : *streams) all += s.messages;
    EXPECT_GE(all, before) << length;
    before = all;
  }
}

INSTANTIATE_TEST_SUITE_P(Files, KnownLog,
                         ::testing::Values("dataflash_arduplane_3.8.2_dev.bin",
                                           "dataflash_arducopter_3.6.8.bin"),
                         [](const auto& file) { return std::string(file.param).substr(10, 9); });

}  // namespace
}  // namespace evpose
