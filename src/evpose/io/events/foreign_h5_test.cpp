// SPDX-License-Identifier: BSD-3-Clause
// HDF5 files in the layouts and compressions of others, made here byte by byte.
#include <blosc.h>
#include <gtest/gtest.h>
#include <hdf5.h>
#include <zstd.h>

#include <algorithm>
#include <cstring>

#include "evpose/io/events/events_h5.h"
#include "evpose/io/files/test_files.h"
#include "evpose/io/hdf5/ecf.h"
#include "evpose/io/hdf5/hdf5_file.h"
#include "evpose/io/hdf5/test_ecf.h"
#include "evpose/io/hdf5/test_hdf5.h"

namespace evpose {
namespace {

std::vector<EcfEvent> read(const std::string& path, const EventReadOptions& options = {}) {
  const auto reader = open_events_h5(path, options);
  EXPECT_TRUE(reader.ok()) << error_line(reader);
  std::vector<EcfEvent> events;
  if (!reader) return events;
  EventPacket packet;
  while (true) {
    const auto more = (*reader)->next(packet);
    EXPECT_TRUE(more.ok()) << error_line(more);
    if (!more || !*more) return events;
    for (const Event& e : packet.events)
      events.push_back({e.x, e.y, static_cast<std::int16_t>(e.on), packet.time(e) / kNsPerUs});
  }
}

hid_t metavision_type() {
  const hid_t type = H5Tcreate(H5T_COMPOUND, sizeof(EcfEvent));
  H5Tinsert(type, "x", offsetof(EcfEvent, x), H5T_NATIVE_UINT16);
  H5Tinsert(type, "y", offsetof(EcfEvent, y), H5T_NATIVE_UINT16);
  H5Tinsert(type, "p", offsetof(EcfEvent, p), H5T_NATIVE_INT16);
  H5Tinsert(type, "t", offsetof(EcfEvent, t_us), H5T_NATIVE_INT64);
  return type;
}

std::string ecf_chunk(const std::string& rows, EcfPacking packing) {
  std::vector<EcfEvent> events(rows.size() / sizeof(EcfEvent));
  std::memcpy(events.data(), rows.data(), rows.size());
  // The end of the last chunk was never written.
  while (!events.empty() && events.back().t_us == 0) events.pop_back();
  return encode_ecf(events, packing);
}

TEST(MetavisionH5, EventsAndTriggersAreReadWithoutAPlugIn) {
  const TemporaryFolder folder;
  const auto events = some_ecf_events(50'000);
  struct StoredTrigger {
    std::int16_t p, pad[3];
    std::int64_t t;
    std::int16_t id, more[3];
  };
  const hid_t trigger_type = H5Tcreate(H5T_COMPOUND, sizeof(StoredTrigger));
  H5Tinsert(trigger_type, "p", 0, H5T_NATIVE_INT16);
  H5Tinsert(trigger_type, "t", 8, H5T_NATIVE_INT64);
  H5Tinsert(trigger_type, "id", 16, H5T_NATIVE_INT16);
  for (const EcfPacking packing : {EcfPacking::none, EcfPacking::columns, EcfPacking::all}) {
    const std::string path = folder / "a.hdf5";
    ForeignFile file(path);
    file.put(
        "/CD/events", metavision_type(), events, 0x8ECF,
        [&](const std::string& rows) { return ecf_chunk(rows, packing); }, 16384);
    file.put("/EXT_TRIGGER/events", trigger_type,
             std::vector<StoredTrigger>{{1, {}, 1'000'500, 6, {}}, {0, {}, 1'000'900, 6, {}}});
    file.put_text("geometry", "1280x720");
    file.close();
    EXPECT_TRUE(same_events(read(path), events));
    const auto reader = open_events_h5(path, {});
    EXPECT_EQ((*reader)->size(), (ImageSize{1280, 720}));
    EXPECT_EQ((*reader)->extent().count, 50'000);
    EXPECT_EQ((*reader)->extent().last_ns, events.back().t_us * kNsPerUs);
    EventReadOptions late;
    late.t_start_ns = events[40'000].t_us * kNsPerUs;
    const auto tail = read(path, late);
    const auto first = std::find_if(events.begin(), events.end(),
                                    [&](const EcfEvent& e) { return e.t_us == events[40'000].t_us; });
    EXPECT_TRUE(same_events(tail, {first, events.end()}));
    std::vector<Trigger> triggers;
    SensorSink sink;
    sink.trigger = [&](const Trigger& trigger) { triggers.push_back(trigger); };
    ASSERT_TRUE(read_h5_sensors(path, sink).ok());
    ASSERT_EQ(triggers.size(), 2u);
    EXPECT_EQ(triggers[0].t, 1'000'500'000);
    EXPECT_TRUE(triggers[0].on);
    EXPECT_EQ(triggers[1].id, 6);
    EXPECT_EQ(list_h5_streams(path).value().size(), 2u);
  }
}

std::string blosc(const std::string& bytes, std::size_t item, const char* compressor) {
  std::string out(bytes.size() + BLOSC_MAX_OVERHEAD, '\0');
  const int size = blosc_compress_ctx(5, BLOSC_SHUFFLE, item, bytes.size(), bytes.data(), out.data(),
                                      out.size(), compressor, 0, 1);
  EXPECT_GT(size, 0);
  out.resize(static_cast<std::size_t>(size));
  return out;
}

std::string zstd(const std::string& bytes) {
  std::string out(ZSTD_compressBound(bytes.size()), '\0');
  out.resize(ZSTD_compress(out.data(), out.size(), bytes.data(), bytes.size(), 3));
  return out;
}

/// Blocks of plain bytes, as its filter writes what does not become smaller.
std::string lz4_plain(const std::string& bytes) {
  const auto big = [](std::uint64_t value, int size) {
    std::string s;
    for (int i = size - 1; i >= 0; --i) s += static_cast<char>(value >> 8 * i & 0xFF);
    return s;
  };
  return big(bytes.size(), 8) + big(bytes.size(), 4) + big(bytes.size(), 4) + bytes;
}

/// Columns as DSEC has them, by a filter.
void write_dsec(const std::string& path, const std::vector<EcfEvent>& events, H5Z_filter_t filter,
                const std::function<std::string(const std::string&, std::size_t)>& pack) {
  ForeignFile file(path);
  std::vector<std::uint16_t> x, y;
  std::vector<std::uint8_t> p;
  std::vector<std::uint32_t> t;
  const std::int64_t offset = 500'000;
  for (const EcfEvent& e : events) {
    x.push_back(e.x), y.push_back(e.y), p.push_back(static_cast<std::uint8_t>(e.p));
    t.push_back(static_cast<std::uint32_t>(e.t_us - offset));
  }
  const auto of = [&](std::size_t item) {
    return [&pack, item](const std::string& s) { return pack(s, item); };
  };
  file.put("/events/x", H5T_NATIVE_UINT16, x, filter, of(2));
  file.put("/events/y", H5T_NATIVE_UINT16, y, filter, of(2));
  file.put("/events/p", H5T_NATIVE_UINT8, p, filter, of(1));
  file.put("/events/t", H5T_NATIVE_UINT32, t, filter, of(4));
  file.put("/t_offset", H5T_NATIVE_INT64, std::vector<std::int64_t>{offset});
  std::vector<std::uint64_t> index;
  for (std::uint64_t i = 0, ms = 0; i < t.size(); ++ms) {
    while (i < t.size() && t[i] < 1000 * ms) ++i;
    index.push_back(i);
  }
  file.put("/ms_to_idx", H5T_NATIVE_UINT64, index);
}

TEST(DsecH5, ColumnsInTheCompressionsOfOthers) {
  const TemporaryFolder folder;
  const auto events = some_ecf_events(20'500);
  const auto check = [&](const char* name, H5Z_filter_t filter, const auto& pack) {
    write_dsec(folder / name, events, filter, pack);
    EXPECT_TRUE(same_events(read(folder / name), events)) << name;
  };
  ASSERT_TRUE(Hdf5File::open(folder.file("x", "x")).ok() == false);  // filters are known from here on
  for (const char* compressor : {"blosclz", "lz4", "zstd", "zlib"})
    check(compressor, 32001,
          [&](const std::string& s, std::size_t item) { return blosc(s, item, compressor); });
  check("zstandard", 32015, [](const std::string& s, std::size_t) { return zstd(s); });
  check("lz4f", 32004, [](const std::string& s, std::size_t) { return lz4_plain(s); });
}

TEST(DsecH5, ReadingBeginsWhereTheIndexSaysAndAlsoWhereItLies) {
  const TemporaryFolder folder;
  const auto events = some_ecf_events(20'000);
  const auto pack = [](const std::string& s, std::size_t) { return zstd(s); };
  write_dsec(folder / "a.h5", events, 32015, pack);
  for (const std::size_t i : {0u, 1u, 5000u, 12'345u, 19'999u}) {
    EventReadOptions options;
    options.t_start_ns = events[i].t_us * kNsPerUs;
    const auto first = std::find_if(events.begin(), events.end(),
                                    [&](const EcfEvent& e) { return e.t_us == events[i].t_us; });
    EXPECT_TRUE(same_events(read(folder / "a.h5", options), {first, events.end()})) << i;
  }
}

TEST(DsecH5, DamagedChunksAreAnError) {
  const TemporaryFolder folder;
  const auto events = some_ecf_events(5000);
  const auto spoil = [](std::string s) {
    s[s.size() / 2] = static_cast<char>(s[s.size() / 2] ^ 0x55);
    return s.substr(0, s.size() - 9);
  };
  const auto error_of = [&](H5Z_filter_t filter, const auto& pack) {
    write_dsec(folder / "a.h5", events, filter, pack);
    const auto reader = open_events_h5(folder / "a.h5", {});
    if (!reader) return reader.error().line();
    EventPacket packet;
    for (auto more = (*reader)->next(packet);; more = (*reader)->next(packet)) {
      if (!more) return more.error().line();
      if (!*more) return std::string("(no error)");
    }
  };
  EXPECT_TRUE(says(
      error_of(32001, [&](const std::string& s, std::size_t item) { return spoil(blosc(s, item, "zstd")); }),
      {"a.h5", "cannot be read"}));
  EXPECT_TRUE(says(error_of(32015, [&](const std::string& s, std::size_t) { return spoil(zstd(s)); }),
                   {"cannot be read"}));
  // Half a chunk, sound in itself: HDF5 would read beyond its end.
  EXPECT_TRUE(says(
      error_of(32015, [&](const std::string& s, std::size_t) { return zstd(s.substr(0, s.size() / 2)); }),
      {"cannot be read"}));
}

TEST(DsecH5, AFileThatBreaksTheLibraryDownIsRefused) {
  const TemporaryFolder folder;
  write_dsec(folder / "a.h5", some_ecf_events(5000), 32015,
             [](const std::string& s, std::size_t) { return zstd(s); });
  ASSERT_TRUE(Hdf5File::open(folder / "a.h5").ok());
  std::string bytes = content_of(folder / "a.h5");
  // The layout message of a dataset of one dimension in chunks, said to be of an older version: HDF5 1.10
  // divides by zero when it opens the dataset.
  constexpr std::string_view message("\x08\0\x18\0\0\0\0\0\x03\x02\x02", 11);
  const auto at = bytes.find(message);
  ASSERT_NE(at, std::string::npos);
  bytes[at + 8] = 2;
  const auto file = Hdf5File::open(folder.file("b.h5", bytes));
  ASSERT_FALSE(file.ok());
  EXPECT_TRUE(says(file.error().line(), {"b.h5", "damaged", "copy it again"}));
}

TEST(MvsecH5, EventsAndImuOfACamera) {
  const TemporaryFolder folder;
  const std::string path = folder / "a.hdf5";
  ForeignFile file(path);
  file.put_matrix("/davis/left/events", {3, 4, 1504645177.4247, -1, 5, 6, 1504645177.424701, 1}, 4);
  file.put_matrix("/davis/right/events", {7, 8, 1504645177.5, 1}, 4);
  file.put_matrix("/davis/left/imu", {0.1, 9.8, 0.2, 1, 2, 3}, 6);
  file.put("/davis/left/imu_ts", H5T_NATIVE_DOUBLE, std::vector<double>{1504645177.25});
  file.close();
  EXPECT_TRUE(same_events(read(path), {{3, 4, 0, 1504645177424700}, {5, 6, 1, 1504645177424701}}));
  EventReadOptions right;
  right.topic = "right";
  EXPECT_TRUE(same_events(read(path, right), {{7, 8, 1, 1504645177500000}}));
  std::vector<ImuSample> samples;
  SensorSink sink;
  sink.imu = [&](const ImuSample& sample) { samples.push_back(sample); };
  ASSERT_TRUE(read_h5_sensors(path, sink).ok());
  ASSERT_EQ(samples.size(), 1u);
  EXPECT_EQ(samples[0].t, 1504645177250000000);
  EXPECT_EQ(samples[0].accel[1], 9.8);
  EXPECT_EQ(samples[0].gyro[2], 3);
  EXPECT_EQ(list_h5_streams(path).value().size(), 3u);
}

}  // namespace
}  // namespace evpose
