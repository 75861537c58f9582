// SPDX-License-Identifier: BSD-3-Clause
// How fast each format of events is read, from the file in the page cache to checked packets, on one core.
#include <benchmark/benchmark.h>
#include <hdf5.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <unistd.h>

#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <functional>
#include <random>

#include "evpose/io/files/input_file.h"
#include "evpose/io/formats/create_event_writer.h"
#include "evpose/io/formats/open_events.h"

namespace evpose {
namespace {

constexpr ImageSize kSize = {1280, 720};
constexpr std::size_t kEvents = 4 << 20;
constexpr double kRateMevS = 10;

/// Where a camera sees edges move: short runs of neighbours in a row, at a rate of 10 Mev/s.
std::vector<EventPacket> synthetic_packets() {
  std::mt19937 random(1);
  std::vector<EventPacket> packets;
  double t_us = 0;
  for (std::size_t made = 0; made < kEvents;) {
    EventPacket packet;
    packet.base = 1000 * kNsPerUs * static_cast<TimeNs>(t_us / 1000);
    const TimeNs whole_us = packet.base / kNsPerUs;
    const auto base_us = static_cast<double>(whole_us);
    const double end_us = 1000.0 * static_cast<double>(packets.size() + 1);
    while (t_us < end_us && made < kEvents) {
      const int run = 1 + static_cast<int>(random() % 5), y = static_cast<int>(random() % 720);
      const int x = static_cast<int>(random() % 1270);
      const bool on = random() % 2 == 0;
      for (int i = 0; i < run; ++i, ++made)
        packet.events.push_back(make_event(static_cast<std::uint32_t>(t_us - base_us), x + i, y, on));
      t_us += run / kRateMevS;
    }
    packets.push_back(std::move(packet));
  }
  return packets;
}

void append(std::string& out, const void* data, std::size_t size) {
  out.append(static_cast<const char*>(data), size);
}

std::string evt2_file(const std::vector<EventPacket>& packets) {
  std::string out = "% evt 2.0\n% format EVT2;height=720;width=1280\n% end\n";
  std::int64_t high = -1;
  for (const EventPacket& packet : packets) {
    for (const Event& e : packet.events) {
      const std::int64_t t_us = packet.time(e) / kNsPerUs;
      while (high < t_us >> 6) {
        const std::uint32_t word = 0x80000000u | static_cast<std::uint32_t>(++high);
        append(out, &word, 4);
      }
      const std::uint32_t word = static_cast<std::uint32_t>(e.on) << 28 |
                                 static_cast<std::uint32_t>(t_us & 63) << 22 |
                                 static_cast<std::uint32_t>(e.x) << 11 | e.y;
      append(out, &word, 4);
    }
  }
  return out;
}

/// Each event is a word of its own: the worst case of that format.
std::string evt21_file(const std::vector<EventPacket>& packets) {
  std::string out = "% evt 2.1\n% format EVT21;endianness=little;height=720;width=1280\n% end\n";
  std::int64_t high = -1;
  for (const EventPacket& packet : packets) {
    for (const Event& e : packet.events) {
      const std::int64_t t_us = packet.time(e) / kNsPerUs;
      while (high < t_us >> 6) {
        const std::uint64_t word = std::uint64_t{8} << 60 | static_cast<std::uint64_t>(++high) << 32;
        append(out, &word, 8);
      }
      const std::uint64_t word = static_cast<std::uint64_t>(e.on) << 60 |
                                 static_cast<std::uint64_t>(t_us & 63) << 54 |
                                 static_cast<std::uint64_t>(e.x / 32 * 32) << 43 |
                                 static_cast<std::uint64_t>(e.y) << 32 | 1u << e.x % 32;
      append(out, &word, 8);
    }
  }
  return out;
}

std::string dat_file(const std::vector<EventPacket>& packets) {
  std::string out = "% Version 2\n% Width 1280\n% Height 720\n";
  out += std::string("\x0C\x08", 2);
  for (const EventPacket& packet : packets) {
    for (const Event& e : packet.events) {
      const std::uint32_t words[] = {static_cast<std::uint32_t>(packet.time(e) / kNsPerUs),
                                     static_cast<std::uint32_t>(e.x) | static_cast<std::uint32_t>(e.y) << 14 |
                                         static_cast<std::uint32_t>(e.on) << 28};
      append(out, words, 8);
    }
  }
  return out;
}

/// A file in memory, gone with the program.
std::string file_of(const std::string& content) {
  const int descriptor = ::memfd_create("evpose-bench", 0);
  if (::write(descriptor, content.data(), content.size()) != static_cast<ssize_t>(content.size()))
    std::abort();
  return "/proc/self/fd/" + std::to_string(descriptor);
}

/// Through a writer, which needs a name of its own on a disk.
std::string written(const std::vector<EventPacket>& packets, const std::string& extension) {
  std::string path =
      std::filesystem::temp_directory_path() / ("evpose-bench-" + std::to_string(::getpid()) + extension);
  auto writer = create_event_writer(path, "", kSize);
  if (!writer) std::abort();
  for (const EventPacket& packet : packets)
    if (!(*writer)->append(packet)) std::abort();
  if (!(*writer)->finish()) std::abort();
  return path;
}

void count(benchmark::State& state, const std::string& path, std::int64_t events) {
  const auto bytes = static_cast<double>(std::filesystem::file_size(path));
  state.counters["Mev/s"] =
      benchmark::Counter(static_cast<double>(events) * 1e-6, benchmark::Counter::kIsRate);
  state.counters["MB/s"] =
      benchmark::Counter(static_cast<double>(state.iterations()) * bytes * 1e-6, benchmark::Counter::kIsRate);
  state.counters["bytes/event"] =
      bytes * static_cast<double>(state.iterations()) / static_cast<double>(events);
}

void read_file(benchmark::State& state, const std::string& path) {
  std::int64_t events = 0;
  for (auto _ : state) {
    const auto reader = open_events(path, "", {});
    if (!reader) {
      state.SkipWithError(reader.error().line().c_str());
      return;
    }
    EventPacket packet;
    while (true) {
      const auto more = (*reader)->next(packet);
      if (!more || !*more) break;
      events += static_cast<std::int64_t>(packet.events.size());
      benchmark::DoNotOptimize(packet.events.data());
    }
  }
  count(state, path, events);
}

/// What cannot be beaten: as many events, copied from one place in memory to another.
void copy(benchmark::State& state) {
  std::vector<Event> from(kEvents), to(kEvents);
  for (auto _ : state) {
    std::memcpy(to.data(), from.data(), kEvents * sizeof(Event));
    benchmark::DoNotOptimize(to.data());
    benchmark::ClobberMemory();
  }
  const auto total = static_cast<double>(state.iterations()) * static_cast<double>(kEvents);
  state.counters["Mev/s"] = benchmark::Counter(total * 1e-6, benchmark::Counter::kIsRate);
  state.counters["MB/s"] = benchmark::Counter(total * sizeof(Event) * 1e-6, benchmark::Counter::kIsRate);
}

/// Another's decoder of the same file: the HDF5 library, all of each column at once, unpacked and no more.
void read_columns(benchmark::State& state, const std::string& path) {
  std::int64_t events = 0;
  for (auto _ : state) {
    const hid_t file = H5Fopen(path.c_str(), H5F_ACC_RDONLY, H5P_DEFAULT);
    for (const char* name : {"events/x", "events/y", "events/p", "events/t"}) {
      const hid_t set = H5Dopen2(file, name, H5P_DEFAULT), type = H5Dget_type(set), space = H5Dget_space(set);
      const auto rows = static_cast<std::size_t>(H5Sget_simple_extent_npoints(space));
      std::vector<std::byte> column(rows * H5Tget_size(type));
      if (H5Dread(set, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, column.data()) < 0) std::abort();
      benchmark::DoNotOptimize(column.data());
      if (name == std::string("events/t")) events += static_cast<std::int64_t>(rows);
      H5Sclose(space), H5Tclose(type), H5Dclose(set);
    }
    H5Fclose(file);
  }
  count(state, path, events);
}

/// Another's reader of text: the C library's sscanf on each line, with no checks.
void scan_text(benchmark::State& state, const std::string& path) {
  std::int64_t events = 0;
  for (auto _ : state) {
    auto lines = LineReader::open(path);
    if (!lines) std::abort();
    std::string_view view;
    std::string line;
    double t = 0;
    int x = 0, y = 0, p = 0;
    while (*lines->next(view)) {
      line = view;
      const int fields = std::sscanf(line.c_str(), "%lf %d %d %d", &t, &x, &y, &p);  // NOLINT(cert-err34-c)
      events += fields == 4 ? 1 : 0;
      benchmark::DoNotOptimize(t);
    }
  }
  count(state, path, events);
}

/// A file of so many gigabytes as nobody wants to hold in memory: written, then read once.
void long_file(benchmark::State& state, double gigabytes) {
  const std::string path =
      std::filesystem::temp_directory_path() / ("evpose-bench-" + std::to_string(::getpid()) + "-long.raw");
  const std::vector<EventPacket> packets = synthetic_packets();
  const TimeNs span = packets.back().base + kNsPerMs;
  auto writer = create_event_writer(path, "", kSize);
  if (!writer) std::abort();
  EventPacket packet;
  TimeNs shift = 0;
  for (double written_gb = 0; written_gb < gigabytes; written_gb += 1e-9 * 2.067 * kEvents) {
    for (const EventPacket& p : packets) {
      packet = p;
      packet.base += shift;
      if (!(*writer)->append(packet)) std::abort();
    }
    shift += span;
  }
  if (!(*writer)->finish()) std::abort();
  struct rusage before = {}, after = {};
  ::getrusage(RUSAGE_SELF, &before);
  read_file(state, path);
  ::getrusage(RUSAGE_SELF, &after);
  state.counters["GB"] = 1e-9 * static_cast<double>(std::filesystem::file_size(path));
  state.counters["peak_MB_before"] = 1e-3 * static_cast<double>(before.ru_maxrss);
  state.counters["peak_MB_after"] = 1e-3 * static_cast<double>(after.ru_maxrss);
  std::filesystem::remove(path);
}

std::string shared_folder() {
  const char* variable = std::getenv("EVPOSE_SHARED");
  return std::string(variable != nullptr ? variable : "../shared") + "/data/real/formats/";
}

using Read = void (*)(benchmark::State&, const std::string&);

void add(const std::string& name, const std::function<std::string()>& make, bool remove,
         Read read = read_file) {
  benchmark::RegisterBenchmark(("decode/" + name).c_str(), [=](benchmark::State& state) {
    const std::string path = make();
    read(state, path);
    if (remove) std::filesystem::remove(path);
  })->Unit(benchmark::kMillisecond);
}

/// The files are made when their benchmark runs.
bool register_all() {
  benchmark::RegisterBenchmark("decode/memory_copy", copy)->Unit(benchmark::kMillisecond);
  add(
      "synthetic EVT2", [] { return file_of(evt2_file(synthetic_packets())); }, false);
  add(
      "synthetic EVT2.1", [] { return file_of(evt21_file(synthetic_packets())); }, false);
  add(
      "synthetic DAT", [] { return file_of(dat_file(synthetic_packets())); }, false);
  for (const char* extension : {".raw", ".h5", ".txt", ".csv", ".bag", ".mcap"})
    add(
        std::string("synthetic ") + extension, [=] { return written(synthetic_packets(), extension); }, true);
  add(
      "others: libhdf5, columns of synthetic .h5", [] { return written(synthetic_packets(), ".h5"); }, true,
      read_columns);
  add(
      "others: sscanf, synthetic .txt", [] { return written(synthetic_packets(), ".txt"); }, true, scan_text);
  if (const char* gigabytes = std::getenv("EVPOSE_BENCH_GB"))
    benchmark::RegisterBenchmark("decode/long EVT3",
                                 [=](benchmark::State& state) { long_file(state, std::atof(gigabytes)); })
        ->Iterations(1)
        ->Unit(benchmark::kSecond);
  std::error_code none;
  for (const char* name :
       {"prophesee_evt2_gen3.raw", "prophesee_evt3_gen41.raw", "dvxplorer_events_imu.aedat4",
        "event_stream_dvs_cut.es", "ncaltech101_faces_easy_0001.bin", "event_packet_evt3_ros1.bag",
        "event_packet_evt3_ros2.db3", "event_packet_libcaer_cmp.mcap"})
    if (std::filesystem::exists(shared_folder() + name, none))
      add(
          name, [=] { return shared_folder() + name; }, false);
  return true;
}

const bool kRegistered = register_all();

}  // namespace
}  // namespace evpose
