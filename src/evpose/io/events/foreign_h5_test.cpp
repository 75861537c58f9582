// SPDX-License-Identifier: BSD-3-Clause
// HDF5 files in the layouts and compressions of others, made here byte by byte.
#include <blosc.h>
#include <gtest/gtest.h>
#include <hdf5.h>
#include <zstd.h>

#include <algorithm>
#include <cstring>
#include <functional>
#include <random>

#include "evpose/io/events/events_h5.h"
#include "evpose/io/files/test_files.h"
#include "evpose/io/hdf5/ecf.h"
#include "evpose/io/hdf5/hdf5_file.h"
#include "evpose/io/hdf5/test_ecf.h"

namespace evpose {
namespace {

using Pack = std::function<std::string(const std::string&)>;

/// A file whose chunks are written as they shall stand there.
class ForeignFile {
 public:
  explicit ForeignFile(const std::string& path)
      : path_(path), file_(H5Fcreate(path.c_str(), H5F_ACC_TRUNC, H5P_DEFAULT, H5P_DEFAULT)) {
    EXPECT_GE(file_, 0);
  }
  ForeignFile(const ForeignFile&) = delete;
  ForeignFile& operator=(const ForeignFile&) = delete;
  ~ForeignFile() { close(); }
  void close() {
    if (file_ >= 0) H5Fclose(file_);
    file_ = -1;
  }

  template <class T>
  void put(const std::string& name, hid_t type, const std::vector<T>& rows, H5Z_filter_t filter = 0,
           const Pack& pack = nullptr, hsize_t chunk = 1000, std::vector<unsigned> parameters = {}) {
    const hsize_t count = rows.size();
    const hid_t space = H5Screate_simple(1, &count, nullptr), properties = H5Pcreate(H5P_DATASET_CREATE),
                links = H5Pcreate(H5P_LINK_CREATE);
    H5Pset_create_intermediate_group(links, 1);
    if (filter != 0) {
      H5Pset_chunk(properties, 1, &chunk);
      H5Pset_filter(properties, filter, H5Z_FLAG_OPTIONAL, parameters.size(), parameters.data());
    }
    const hid_t set = H5Dcreate2(file_, name.c_str(), type, space, links, properties, H5P_DEFAULT);
    ASSERT_GE(set, 0);
    if (filter == 0) {
      EXPECT_GE(H5Dwrite(set, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, rows.data()), 0);
    }
    for (hsize_t at = 0; filter != 0 && at < count; at += chunk) {
      std::string bytes(chunk * sizeof(T), '\0');
      std::memcpy(bytes.data(), rows.data() + at, std::min<std::size_t>(chunk, count - at) * sizeof(T));
      const std::string packed = pack(bytes);
      EXPECT_GE(H5Dwrite_chunk(set, H5P_DEFAULT, 0, &at, packed.size(), packed.data()), 0);
    }
    H5Dclose(set), H5Pclose(links), H5Pclose(properties), H5Sclose(space);
  }

  void put_text(const char* name, const std::string& value) {
    const hid_t type = H5Tcopy(H5T_C_S1), space = H5Screate(H5S_SCALAR);
    H5Tset_size(type, H5T_VARIABLE);
    const hid_t attribute = H5Acreate2(file_, name, type, space, H5P_DEFAULT, H5P_DEFAULT);
    const char* pointer = value.c_str();
    EXPECT_GE(H5Awrite(attribute, type, static_cast<const void*>(&pointer)), 0);
    H5Aclose(attribute), H5Sclose(space), H5Tclose(type);
  }

  void put_matrix(const std::string& name, const std::vector<double>& values, hsize_t columns) {
    const hsize_t shape[] = {values.size() / columns, columns};
    const hid_t space = H5Screate_simple(2, shape, nullptr), links = H5Pcreate(H5P_LINK_CREATE);
    H5Pset_create_intermediate_group(links, 1);
    const hid_t set =
        H5Dcreate2(file_, name.c_str(), H5T_NATIVE_DOUBLE, space, links, H5P_DEFAULT, H5P_DEFAULT);
    EXPECT_GE(H5Dwrite(set, H5T_NATIVE_DOUBLE, H5S_ALL, H5S_ALL, H5P_DEFAULT, values.data()), 0);
    H5Dclose(set), H5Pclose(links), H5Sclose(space);
  }

 private:
  std::string path_;
  hid_t file_;
};

std::vector<EcfEvent> some_events(std::size_t count) {
  std::mt19937 engine(11);
  const auto random = [&] { return static_cast<unsigned>(engine()); };
  std::vector<EcfEvent> events(count);
  std::int64_t t = 1'000'000;
  unsigned x = 0, y = 0;
  for (EcfEvent& e : events) {
    const unsigned kind = random() % 16;
    t += kind < 12 ? 0 : kind < 15 ? random() % 40 : random() % 3000;
    if (kind > 4) y = random() % 720;
    x = kind < 6 ? (x + 1 + random() % 5) % 1280 : random() % 1280;
    e = {static_cast<std::uint16_t>(x), static_cast<std::uint16_t>(y),
         static_cast<std::int16_t>(random() / 7 % 2), t};
  }
  return events;
}

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

bool same(const std::vector<EcfEvent>& a, const std::vector<EcfEvent>& b) {
  return std::equal(a.begin(), a.end(), b.begin(), b.end(), [](const EcfEvent& l, const EcfEvent& r) {
    return l.x == r.x && l.y == r.y && l.p == r.p && l.t_us == r.t_us;
  });
}

std::span<const std::byte> bytes_of(const std::string& s) { return std::as_bytes(std::span(s)); }

TEST(Ecf, EveryPackingIsUndone) {
  for (const std::size_t count : {0u, 1u, 3u, 4u, 5u, 1000u, 65535u}) {
    const auto events = some_events(count);
    for (const EcfPacking packing : {EcfPacking::none, EcfPacking::columns, EcfPacking::all}) {
      std::vector<EcfEvent> out;
      ASSERT_TRUE(decode_ecf(bytes_of(encode_ecf(events, packing)), out)) << count;
      EXPECT_TRUE(same(out, events)) << count << " " << static_cast<int>(packing);
    }
  }
}

TEST(Ecf, CutOrSpoiltBlocksAreRefusedOrHaveTheirCount) {
  const auto events = some_events(200);
  std::mt19937 random(2);
  std::vector<EcfEvent> out;
  for (const EcfPacking packing : {EcfPacking::none, EcfPacking::columns, EcfPacking::all}) {
    const std::string block = encode_ecf(events, packing);
    for (std::size_t n = 0; n < block.size(); ++n)
      EXPECT_FALSE(decode_ecf(bytes_of(block.substr(0, n)), out)) << n;
    for (int i = 0; i < 2000; ++i) {
      std::string spoilt = block;
      spoilt[random() % spoilt.size()] = static_cast<char>(random());
      if (!decode_ecf(bytes_of(spoilt), out)) continue;
      EXPECT_LE(out.size(), 65535u);
    }
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
  const auto events = some_events(50'000);
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
    EXPECT_TRUE(same(read(path), events));
    const auto reader = open_events_h5(path, {});
    EXPECT_EQ((*reader)->size(), (ImageSize{1280, 720}));
    EXPECT_EQ((*reader)->extent().count, 50'000);
    EXPECT_EQ((*reader)->extent().last_ns, events.back().t_us * kNsPerUs);
    EventReadOptions late;
    late.t_start_ns = events[40'000].t_us * kNsPerUs;
    const auto tail = read(path, late);
    const auto first = std::find_if(events.begin(), events.end(),
                                    [&](const EcfEvent& e) { return e.t_us == events[40'000].t_us; });
    EXPECT_TRUE(same(tail, {first, events.end()}));
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
  const auto events = some_events(20'500);
  const auto check = [&](const char* name, H5Z_filter_t filter, const auto& pack) {
    write_dsec(folder / name, events, filter, pack);
    EXPECT_TRUE(same(read(folder / name), events)) << name;
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
  const auto events = some_events(20'000);
  const auto pack = [](const std::string& s, std::size_t) { return zstd(s); };
  write_dsec(folder / "a.h5", events, 32015, pack);
  for (const std::size_t i : {0u, 1u, 5000u, 12'345u, 19'999u}) {
    EventReadOptions options;
    options.t_start_ns = events[i].t_us * kNsPerUs;
    const auto first = std::find_if(events.begin(), events.end(),
                                    [&](const EcfEvent& e) { return e.t_us == events[i].t_us; });
    EXPECT_TRUE(same(read(folder / "a.h5", options), {first, events.end()})) << i;
  }
}

TEST(DsecH5, DamagedChunksAreAnError) {
  const TemporaryFolder folder;
  const auto events = some_events(5000);
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
  write_dsec(folder / "a.h5", some_events(5000), 32015,
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

TEST(Hdf5, AFileWhoseContentCannotBeListedIsRefused) {
  const TemporaryFolder folder;
  ForeignFile written(folder / "a.h5");
  written.put("/a/x", H5T_NATIVE_DOUBLE, std::vector<double>{1, 2});
  written.put("/b/x", H5T_NATIVE_DOUBLE, std::vector<double>{3});
  written.close();
  ASSERT_TRUE(Hdf5File::open(folder / "a.h5").value().dataset("/b/x").ok());
  // The node with the links of a group: what is in the others could still be asked for by name, untried.
  std::string bytes = content_of(folder / "a.h5");
  const auto at = bytes.rfind("SNOD");
  ASSERT_NE(at, std::string::npos);
  bytes[at] = 'X';
  const auto file = Hdf5File::open(folder.file("b.h5", bytes));
  ASSERT_FALSE(file.ok());
  EXPECT_TRUE(says(file.error().line(), {"b.h5", "damaged", "copy it again"}));
}

TEST(Hdf5, AttributesBeyondTheirMessagesAreDamage) {
  const TemporaryFolder folder;
  for (const hsize_t before : {0, 512}) {  // bytes of somebody else
    const hid_t creation = H5Pcreate(H5P_FILE_CREATE);
    H5Pset_userblock(creation, before);
    const hid_t file = H5Fcreate((folder / "a.h5").c_str(), H5F_ACC_TRUNC, creation, H5P_DEFAULT);
    // So many that the header is continued elsewhere.
    for (const char* name : {"first", "second", "third", "fourth"}) {
      const hsize_t shape[] = {2, 3};
      const hid_t space = H5Screate_simple(2, shape, nullptr);
      const hid_t attribute = H5Acreate2(file, name, H5T_STD_I32LE, space, H5P_DEFAULT, H5P_DEFAULT);
      const std::vector<std::int32_t> values{1, 2, 3, 4, 5, 6};
      ASSERT_GE(H5Awrite(attribute, H5T_NATIVE_INT32, values.data()), 0);
      H5Aclose(attribute), H5Sclose(space);
    }
    H5Pclose(creation), H5Fclose(file);
    const auto sound = Hdf5File::open(folder / "a.h5");
    ASSERT_TRUE(sound.ok()) << before;
    EXPECT_EQ(sound->attribute_numbers("/", "fourth"), (std::vector<double>{1, 2, 3, 4, 5, 6}));

    const std::string bytes = content_of(folder / "a.h5");
    for (const char* name : {"first", "fourth"}) {
      const auto at = bytes.find(name);  // after version, reserved, lengths of name, type and shape
      ASSERT_NE(at, std::string::npos);
      const auto refused = [&](std::size_t where, char value) {
        std::string changed = bytes;
        changed[where] = value;
        const auto opened = Hdf5File::open(folder.file("b.h5", changed));
        return !opened.ok() && says(opened.error().line(), {"b.h5", "damaged"});
      };
      EXPECT_TRUE(refused(at - 5, 0x70)) << "a name of 28,000 bytes: " << name;
      EXPECT_TRUE(refused(at - 3, 0x70)) << "a type: " << name;
      EXPECT_TRUE(refused(at - 1, 0x70)) << "a shape: " << name;
      constexpr std::size_t kName = 8, kType = 16;  // as stored
      EXPECT_TRUE(refused(at + kName + 4, 0x70)) << "elements of 112 bytes: " << name;
      EXPECT_TRUE(refused(at + kName + kType + 8, 0x70)) << "112 times 3 elements: " << name;
    }
  }
}

TEST(Hdf5, FiltersBeyondTheirMessagesAreDamage) {
  const TemporaryFolder folder;
  const hid_t file = H5Fcreate((folder / "a.h5").c_str(), H5F_ACC_TRUNC, H5P_DEFAULT, H5P_DEFAULT);
  const hid_t properties = H5Pcreate(H5P_DATASET_CREATE);
  const hsize_t rows = 100;
  H5Pset_chunk(properties, 1, &rows), H5Pset_shuffle(properties), H5Pset_deflate(properties, 4);
  const hid_t space = H5Screate_simple(1, &rows, nullptr);
  const hid_t set = H5Dcreate2(file, "x", H5T_STD_I16LE, space, H5P_DEFAULT, properties, H5P_DEFAULT);
  ASSERT_GE(set, 0);
  H5Dclose(set), H5Sclose(space), H5Pclose(properties), H5Fclose(file);
  ASSERT_TRUE(Hdf5File::open(folder / "a.h5").value().dataset("/x").ok());
  const std::string bytes = content_of(folder / "a.h5");
  for (const char* name : {"shuffle", "deflate"}) {
    const auto at = bytes.find(name);  // after number, length of the name, flags and number of values
    ASSERT_NE(at, std::string::npos);
    for (const std::size_t length : {at - 5, at - 1}) {
      std::string changed = bytes;
      changed[length] = 0x70;
      const auto opened = Hdf5File::open(folder.file("b.h5", changed));
      ASSERT_FALSE(opened.ok()) << name;
      EXPECT_TRUE(says(opened.error().line(), {"b.h5", "damaged"}));
    }
  }
}

TEST(Hdf5, AttributesWithBitsWhereNoNumberHasThemAreNone) {
  const TemporaryFolder folder;
  const hid_t file = H5Fcreate((folder / "a.h5").c_str(), H5F_ACC_TRUNC, H5P_DEFAULT, H5P_DEFAULT);
  const hid_t space = H5Screate(H5S_SCALAR);
  struct Float {
    std::size_t bytes, exponent_bits, mantissa_bits;  // mantissa, exponent and sign from bit 0 on
    bool sound;
  };
  for (const auto& [bytes, exponent, mantissa, sound] : {Float{2, 5, 10, true},
                                                         {4, 8, 23, true},
                                                         {8, 11, 52, true},
                                                         {16, 15, 112, true},
                                                         {16, 70, 50, false},
                                                         {32, 15, 112, false}}) {
    const hid_t type = H5Tcopy(H5T_IEEE_F64LE);
    const std::size_t bits = mantissa + exponent + 1;
    ASSERT_GE(H5Tset_size(type, 32), 0);
    ASSERT_GE(H5Tset_precision(type, 256), 0);
    ASSERT_GE(H5Tset_fields(type, bits - 1, mantissa, exponent, 0, mantissa), 0);
    ASSERT_GE(H5Tset_precision(type, bits), 0);
    ASSERT_GE(H5Tset_size(type, bytes), 0);
    H5Tset_ebias(type, (std::size_t{1} << (std::min<std::size_t>(exponent, 60) - 1)) - 1);
    EXPECT_EQ(is_sound_number(type), sound) << bytes << " bytes";
    const std::string name = text("f", bytes, '_', exponent);
    const hid_t attribute = H5Acreate2(file, name.c_str(), type, space, H5P_DEFAULT, H5P_DEFAULT);
    ASSERT_GE(attribute, 0);
    const std::string zeros(bytes, '\0');
    ASSERT_GE(H5Awrite(attribute, type, zeros.data()), 0);
    H5Aclose(attribute), H5Tclose(type);
  }
  H5Sclose(space), H5Fclose(file);
  const auto opened = Hdf5File::open(folder / "a.h5");
  ASSERT_TRUE(opened.ok());
  for (const char* name : {"f2_5", "f4_8", "f8_11", "f16_15"})
    EXPECT_EQ(opened->attribute_numbers("/", name), std::vector<double>{0}) << name;
  for (const char* name : {"f16_70", "f32_15"}) EXPECT_FALSE(opened->attribute_numbers("/", name)) << name;
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
  EXPECT_TRUE(same(read(path), {{3, 4, 0, 1504645177424700}, {5, 6, 1, 1504645177424701}}));
  EventReadOptions right;
  right.topic = "right";
  EXPECT_TRUE(same(read(path, right), {{7, 8, 1, 1504645177500000}}));
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
