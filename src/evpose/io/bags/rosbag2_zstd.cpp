// SPDX-License-Identifier: BSD-3-Clause
#include <zstd.h>

#include <filesystem>

#include "evpose/core/log.h"
#include "evpose/io/bags/rosbag2.h"
#include "evpose/io/files/atomic_file.h"
#include "evpose/io/files/input_file.h"

namespace evpose {
namespace {

/// A bag in a temporary file that goes with it. Errors name the file that the user knows.
class UnpackedReader : public BagReader {
 public:
  UnpackedReader(std::string path, TemporaryFile unpacked, std::unique_ptr<BagReader> reader)
      : path_(std::move(path)), unpacked_(std::move(unpacked)), reader_(std::move(reader)) {
    topics_ = reader_->topics();
  }
  Status select(const std::vector<std::size_t>& topics) override { return named(reader_->select(topics)); }
  Expected<bool> next(BagMessage& message) override { return named(reader_->next(message)); }
  Status rewind() override { return named(reader_->rewind()); }
  Status go_to_last(std::size_t topic) override { return named(reader_->go_to_last(topic)); }
  Status count_messages() override {
    auto status = named(reader_->count_messages());
    topics_ = reader_->topics();
    return status;
  }

 private:
  template <class T>
  Expected<T> named(Expected<T> result) const {
    if (result) return result;
    return Error{path_ + " (unpacked)", result.error().what, result.error().fix};
  }

  std::string path_;
  TemporaryFile unpacked_;
  std::unique_ptr<BagReader> reader_;
};

struct FreeStream {
  void operator()(ZSTD_DStream* stream) const { ZSTD_freeDStream(stream); }
};

Status unpack(const InputFile& from, std::FILE* to, const std::string& to_path) {
  const std::unique_ptr<ZSTD_DStream, FreeStream> stream(ZSTD_createDStream());
  std::vector<char> in(ZSTD_DStreamInSize()), out(ZSTD_DStreamOutSize());
  std::size_t hint = 0;
  while (const std::size_t got = std::fread(in.data(), 1, in.size(), from.stream.get())) {
    ZSTD_inBuffer input{in.data(), got, 0};
    while (input.pos < input.size) {
      ZSTD_outBuffer output{out.data(), out.size(), 0};
      hint = ZSTD_decompressStream(stream.get(), &output, &input);
      if (ZSTD_isError(hint) != 0)
        return Error{from.path, "its compressed data are damaged", "copy the file again from its source"};
      if (std::fwrite(out.data(), 1, output.pos, to) != output.pos)
        return Error{to_path, "cannot be written", "free space, or set TMPDIR to a folder that has more"};
    }
  }
  if (hint != 0) log_warning(from.path + ": the compressed file is cut off; what is whole before it is read");
  return {};
}

}  // namespace

Expected<std::unique_ptr<BagReader>> open_rosbag2_zstd(const std::string& path) {
  const auto from = open_to_read(path);
  if (!from) return from.error();
  std::error_code ignored;
  const auto folder = std::filesystem::temp_directory_path(ignored);
  auto unpacked = TemporaryFile::create((folder / "evpose-unpacked").string());
  if (!unpacked) return unpacked.error();
  const std::unique_ptr<std::FILE, InputFile::Close> to(std::fopen(unpacked->path().c_str(), "wbe"));
  if (to == nullptr) return Error{unpacked->path(), "cannot be written", "set TMPDIR to another folder"};
  if (auto status = unpack(*from, to.get(), unpacked->path()); !status) return status.error();
  if (std::fflush(to.get()) != 0)
    return Error{unpacked->path(), "cannot be written",
                 "free space, or set TMPDIR to a folder that has more"};
  auto reader = open_bag(unpacked->path());
  if (!reader) return Error{path + " (unpacked)", reader.error().what, reader.error().fix};
  return std::unique_ptr<BagReader>(
      std::make_unique<UnpackedReader>(path, *std::move(unpacked), *std::move(reader)));
}

}  // namespace evpose
