// SPDX-License-Identifier: BSD-3-Clause
#include <array>
#include <limits>
#include <vector>

#include "evpose/io/events/events_h5.h"
#include "evpose/io/files/atomic_file.h"
#include "evpose/io/hdf5/hdf5_file.h"

namespace evpose {
namespace {
constexpr std::size_t kChunk = 65536;
}

struct EventWriterH5::Impl {
  TemporaryFile temporary;
  Hdf5File file;
  ImageSize size;
  Hdf5Handle t, x, y, p;
  std::vector<std::int64_t> t_us;
  std::vector<std::uint16_t> xs, ys;
  std::vector<std::uint8_t> ps;
  std::uint64_t rows = 0;
  std::int64_t last_us = std::numeric_limits<std::int64_t>::min();

  Impl(TemporaryFile name, Hdf5File opened, ImageSize image)
      : temporary(std::move(name)), file(std::move(opened)), size(image) {}

  Status create(const std::string& sensor);
  Status flush();
};

Status EventWriterH5::Impl::create(const std::string& sensor) {
  if (auto status = file.make_group("/events"); !status) return status;
  const struct {
    const char* name;
    NumberType type;
    Hdf5Handle* handle;
  } columns[] = {{"/events/t", NumberType::i64, &t},
                 {"/events/x", NumberType::u16, &x},
                 {"/events/y", NumberType::u16, &y},
                 {"/events/p", NumberType::u8, &p}};
  for (const auto& column : columns) {
    auto made = file.make_dataset(column.name, column.type, {0}, kChunk);
    if (!made) return made.error();
    *column.handle = *std::move(made);
  }
  const std::pair<const char*, int> sides[] = {{"width", size.width}, {"height", size.height}};
  for (const auto& [name, pixels] : sides) {
    const auto value = static_cast<std::uint32_t>(pixels);
    if (auto status = file.set_attribute("/", name, NumberType::u32, {}, &value); !status) return status;
  }
  return file.set_attribute("/", "sensor", sensor);
}

Status EventWriterH5::Impl::flush() {
  const std::uint64_t count = t_us.size();
  const struct {
    Hdf5Handle* handle;
    NumberType type;
    const void* data;
  } columns[] = {{&t, NumberType::i64, t_us.data()},
                 {&x, NumberType::u16, xs.data()},
                 {&y, NumberType::u16, ys.data()},
                 {&p, NumberType::u8, ps.data()}};
  for (const auto& column : columns)
    if (auto status = file.append(*column.handle, column.type, rows, count, column.data); !status)
      return status;
  rows += count;
  t_us.clear(), xs.clear(), ys.clear(), ps.clear();
  return {};
}

EventWriterH5::EventWriterH5(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
EventWriterH5::EventWriterH5(EventWriterH5&& other) noexcept = default;
EventWriterH5& EventWriterH5::operator=(EventWriterH5&& other) noexcept = default;
EventWriterH5::~EventWriterH5() = default;

Expected<EventWriterH5> EventWriterH5::create(const std::string& path, ImageSize size,
                                              const std::string& sensor) {
  EVPOSE_CHECK(size.width > 0 && size.height > 0);
  auto temporary = TemporaryFile::create(path);
  if (!temporary) return temporary.error();
  auto file = Hdf5File::create(*temporary);
  if (!file) return file.error();
  auto impl = std::make_unique<Impl>(*std::move(temporary), *std::move(file), size);
  if (auto status = impl->create(sensor); !status) return status.error();
  return EventWriterH5(std::move(impl));
}

Status EventWriterH5::append(const EventPacket& packet) {
  Impl& m = *impl_;
  for (const Event& e : packet.events) {
    const TimeNs t = packet.time(e);
    const std::int64_t us = t / kNsPerUs - (t % kNsPerUs < 0 ? 1 : 0);
    EVPOSE_CHECK(us >= m.last_us && e.x < m.size.width && e.y < m.size.height);
    m.last_us = us;
    m.t_us.push_back(us);
    m.xs.push_back(e.x);
    m.ys.push_back(e.y);
    m.ps.push_back(e.on);
    if (m.t_us.size() < kChunk) continue;
    if (auto status = m.flush(); !status) return status;
  }
  return {};
}

Status EventWriterH5::finish() {
  Impl& m = *impl_;
  if (auto status = m.flush(); !status) return status;
  for (Hdf5Handle* dataset : {&m.t, &m.x, &m.y, &m.p})
    if (!dataset->reset())
      return Error{m.temporary.target(), "cannot be written", "check the free space of the disk"};
  if (auto status = m.file.close(); !status) return status;
  return m.temporary.commit();
}

}  // namespace evpose
