// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/io/bags/rosbag2.h"

#include <gtest/gtest.h>
#include <sqlite3.h>

#include <filesystem>

#include "evpose/io/bags/bag_streams.h"
#include "evpose/io/bags/bag_writer.h"
#include "evpose/io/files/test_files.h"

namespace evpose {
namespace {

constexpr TimeNs kStart = 1'700'000'000'000'000'000;

void write_mcap(const std::string& path, int first, int count) {
  auto writer = BagWriter::create(path, {640, 480});
  for (int i = first; i < first + count; ++i) {
    EventPacket packet{kStart + i * 20 * kNsPerMs, {}};
    for (int k = 0; k < 50; ++k)
      packet.events.push_back(make_event(static_cast<std::uint32_t>(7 * k), i, k, true));
    ASSERT_TRUE(writer->append(packet).ok());
    ASSERT_TRUE(writer->append(ImuSample{packet.base, {1, 2, 3}, {0.5 * i, 0, 9.81}}).ok());
  }
  ASSERT_TRUE(writer->finish().ok());
}

void run_sql(sqlite3* database, const char* sql) {
  EVPOSE_CHECK(sqlite3_exec(database, sql, nullptr, nullptr, nullptr) == SQLITE_OK);
}

/// The messages of a bag in the tables of a ROS 2 storage file, in another order than that of time.
void write_db3(const std::string& path, const std::string& from, bool zstd, bool index) {
  sqlite3* database = nullptr;
  EVPOSE_CHECK(sqlite3_open(path.c_str(), &database) == SQLITE_OK);
  run_sql(
      database,
      "CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT NOT NULL, type TEXT NOT NULL, "
      "serialization_format TEXT NOT NULL);"
      "CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER NOT NULL, timestamp INTEGER NOT NULL, "
      "data BLOB NOT NULL);"
      "INSERT INTO topics VALUES(7, '/events', 'dvs_msgs/msg/EventArray', 'cdr');"
      "INSERT INTO topics VALUES(9, '/imu', 'sensor_msgs/msg/Imu', 'cdr');");
  if (index) run_sql(database, "CREATE INDEX timestamp_idx ON messages (timestamp ASC);");
  sqlite3_stmt* insert = nullptr;
  sqlite3_prepare_v2(database, "INSERT INTO messages VALUES(?, ?, ?, ?)", -1, &insert, nullptr);
  auto bag = open_bag(from);
  BagMessage message;
  for (int id = 1000; (*bag)->next(message).value(); id += index ? -1 : 1) {
    std::vector<std::byte> data(message.data.begin(), message.data.end());
    if (zstd) data = compress(Compression::zstd, data);
    sqlite3_bind_int(insert, 1, id);
    sqlite3_bind_int(insert, 2, (*bag)->topics()[message.topic].name == "/imu" ? 9 : 7);
    sqlite3_bind_int64(insert, 3, message.t);
    sqlite3_bind_blob(insert, 4, data.data(), static_cast<int>(data.size()), SQLITE_TRANSIENT);
    EVPOSE_CHECK(sqlite3_step(insert) == SQLITE_DONE);
    sqlite3_reset(insert);
  }
  sqlite3_finalize(insert);
  sqlite3_close(database);
}

std::string metadata(const std::string& files, const std::string& more = "") {
  return "rosbag2_bagfile_information:\n  version: 5\n" + more + "  relative_file_paths:\n" + files;
}

/// Rows of the events of `count` packets as written above.
void expect_events(const std::string& path, int count) {
  auto reader = open_events_bag(path, {});
  ASSERT_TRUE(reader.ok()) << error_line(reader);
  EXPECT_EQ((*reader)->extent().first_ns, kStart);
  EXPECT_EQ((*reader)->extent().last_ns, kStart + (count - 1) * 20 * kNsPerMs + 49 * 7000);
  EventPacket packet;
  int seen = 0;
  while (true) {
    const auto more = (*reader)->next(packet);
    ASSERT_TRUE(more.ok()) << error_line(more);
    if (!*more) break;
    for (const Event& e : packet.events) {
      EXPECT_EQ(packet.time(e), kStart + seen / 50 * 20 * kNsPerMs + seen % 50 * 7000);
      EXPECT_EQ(e.x, seen / 50);
      ++seen;
    }
  }
  EXPECT_EQ(seen, 50 * count);
  int samples = 0;
  SensorSink sink;
  sink.imu = [&](const ImuSample& s) { EXPECT_EQ(s.accel.x(), 0.5 * samples++); };
  const auto status = read_bag_sensors(path, "", sink);
  EXPECT_TRUE(status.ok()) << error_line(status);
  EXPECT_EQ(samples, count);
  const auto streams = list_bag_streams(path);
  ASSERT_TRUE(streams.ok());
  ASSERT_EQ(streams->size(), 2u);
  for (const StreamInfo& stream : *streams) EXPECT_EQ(stream.messages, count) << stream.name;
}

TEST(Rosbag2, SqliteIsReadInOrderOfTime) {
  const TemporaryFolder folder;
  write_mcap(folder / "a.mcap", 0, 8);
  write_db3(folder / "a.db3", folder / "a.mcap", false, true);
  expect_events(folder / "a.db3", 8);
}

TEST(Rosbag2, WithoutTheIndexItIsReadInOrderOfTheFile) {
  const TemporaryFolder folder;
  write_mcap(folder / "a.mcap", 0, 8);
  write_db3(folder / "a.db3", folder / "a.mcap", false, false);
  expect_events(folder / "a.db3", 8);
}

TEST(Rosbag2, SplitFilesAreReadOneAfterAnother) {
  const TemporaryFolder folder;
  write_mcap(folder / "a_0.mcap", 0, 5);
  write_mcap(folder / "part.mcap", 5, 4);
  write_db3(folder / "a_1.db3", folder / "part.mcap", false, true);
  std::filesystem::remove(folder / "part.mcap");
  folder.file("metadata.yaml", metadata("    - a_0.mcap\n    - old_name/a_1.db3\n"));
  expect_events(folder.path(), 9);
}

TEST(Rosbag2, WithoutMetadataNumbersGiveTheOrder) {
  const TemporaryFolder folder;
  write_mcap(folder / "a_10.mcap", 6, 3);
  write_mcap(folder / "a_9.mcap", 0, 6);
  expect_events(folder.path(), 9);
}

TEST(Rosbag2, MessagesCompressedOneByOne) {
  const TemporaryFolder folder;
  write_mcap(folder / "part.mcap", 0, 3);
  std::filesystem::rename(folder / "part.mcap", folder / "part.other");
  write_db3(folder / "a.db3", folder / "part.other", true, true);
  folder.file("metadata.yaml",
              metadata("    - a.db3\n", "  compression_format: zstd\n  compression_mode: MESSAGE\n"));
  expect_events(folder.path(), 3);
}

TEST(Rosbag2, FilesCompressedAsAWhole) {
  const TemporaryFolder folder;
  write_mcap(folder / "a.mcap", 0, 3);
  const std::string plain = content_of(folder / "a.mcap");
  const auto packed = compress(Compression::zstd, std::as_bytes(std::span(plain)));
  const std::string bytes(reinterpret_cast<const char*>(packed.data()), packed.size());
  std::filesystem::remove(folder / "a.mcap");
  folder.file("a.mcap.zstd", bytes);
  folder.file("metadata.yaml",
              metadata("    - a.mcap.zstd\n", "  compression_format: zstd\n  compression_mode: FILE\n"));
  expect_events(folder.path(), 3);
  folder.file("a.mcap.zstd", std::string_view(bytes).substr(0, bytes.size() / 2));
  expect_no_harm(list_bag_streams(folder.path()), folder.path(), 0);
}

TEST(Rosbag2, FaultsAreNamed) {
  const TemporaryFolder folder;
  const auto fault = [&](const std::string& yaml) {
    folder.file("metadata.yaml", yaml);
    return error_line(open_bag(folder.path()));
  };
  EXPECT_TRUE(says(fault("a: 1\n"), {"metadata.yaml", "relative_file_paths"}));
  EXPECT_TRUE(says(fault(metadata("    - ../../etc/passwd\n")), {"metadata.yaml", "outside"}));
  EXPECT_TRUE(says(fault(metadata("    - none.db3\n")), {"none.db3", "no such file"}));
  const auto text_file = folder.file("a.txt", "SQLite format 2");
  EXPECT_TRUE(says(error_line(open_bag(text_file)), {"a.txt", "neither"}));
  sqlite3* database = nullptr;
  EVPOSE_CHECK(sqlite3_open((folder / "other.db3").c_str(), &database) == SQLITE_OK);
  run_sql(database, "CREATE TABLE cooks(id INTEGER);");
  run_sql(database, "CREATE VIEW topics AS SELECT 1 AS id; CREATE VIEW messages AS SELECT 1 AS id;");
  sqlite3_close(database);
  EXPECT_TRUE(says(error_line(open_bag(folder / "other.db3")), {"other.db3", "without the tables"}));
}

}  // namespace
}  // namespace evpose
