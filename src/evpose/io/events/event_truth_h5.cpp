// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/io/events/event_truth_h5.h"

#include "evpose/io/files/atomic_file.h"
#include "evpose/io/hdf5/hdf5_file.h"

namespace evpose {
namespace {
constexpr std::size_t kChunk = 65536;
}

struct EventTruthWriter::Impl {
  TemporaryFile temporary;
  Hdf5File file;
  Hdf5Handle cause, origin, object;
  std::vector<std::uint8_t> causes, origins;
  std::vector<std::uint16_t> objects;
  std::uint64_t rows = 0;

  Impl(TemporaryFile name, Hdf5File opened) : temporary(std::move(name)), file(std::move(opened)) {}

  Status make(const char* name, NumberType type, Hdf5Handle& handle) {
    auto made = file.make_dataset(name, type, {0}, kChunk);
    if (!made) return made.error();
    handle = *std::move(made);
    return {};
  }

  Status flush() {
    const std::uint64_t count = causes.size();
    if (auto status = file.append(cause, NumberType::u8, rows, count, causes.data()); !status) return status;
    if (auto status = file.append(origin, NumberType::u8, rows, count, origins.data()); !status)
      return status;
    if (auto status = file.append(object, NumberType::u16, rows, count, objects.data()); !status)
      return status;
    rows += count;
    causes.clear(), origins.clear(), objects.clear();
    return {};
  }
};

EventTruthWriter::EventTruthWriter(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
EventTruthWriter::EventTruthWriter(EventTruthWriter&& other) noexcept = default;
EventTruthWriter& EventTruthWriter::operator=(EventTruthWriter&& other) noexcept = default;
EventTruthWriter::~EventTruthWriter() = default;

Expected<EventTruthWriter> EventTruthWriter::create(const std::string& path,
                                                    const std::vector<std::string>& objects) {
  auto temporary = TemporaryFile::create(path);
  if (!temporary) return temporary.error();
  auto file = Hdf5File::create(*temporary);
  if (!file) return file.error();
  auto impl = std::make_unique<Impl>(*std::move(temporary), *std::move(file));
  if (auto status = impl->file.make_group("/truth"); !status) return status.error();
  if (auto status = impl->make("/truth/cause", NumberType::u8, impl->cause); !status) return status.error();
  if (auto status = impl->make("/truth/origin", NumberType::u8, impl->origin); !status) return status.error();
  if (auto status = impl->make("/truth/object", NumberType::u16, impl->object); !status)
    return status.error();
  if (auto status = impl->file.set_attribute("/", "objects", objects); !status) return status.error();
  return EventTruthWriter(std::move(impl));
}

Status EventTruthWriter::append(const EventTruth& truth) {
  Impl& m = *impl_;
  m.causes.push_back(truth.cause);
  m.origins.push_back(truth.origin);
  m.objects.push_back(truth.object);
  return m.causes.size() < kChunk ? Status{} : m.flush();
}

Status EventTruthWriter::finish() {
  Impl& m = *impl_;
  if (auto status = m.flush(); !status) return status;
  for (Hdf5Handle* dataset : {&m.cause, &m.origin, &m.object})
    if (!dataset->reset())
      return Error{m.temporary.target(), "cannot be written", "check the free space of the disk"};
  if (auto status = m.file.close(); !status) return status;
  return m.temporary.commit();
}

}  // namespace evpose
