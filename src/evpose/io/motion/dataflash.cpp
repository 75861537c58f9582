// SPDX-License-Identifier: BSD-3-Clause
#include "evpose/io/motion/dataflash.h"

#include <algorithm>

#include "evpose/core/log.h"

namespace evpose {
namespace {

constexpr std::size_t kHead = 3;  // two marks and the type
constexpr std::uint8_t kMark1 = 0xA3, kMark2 = 0x95, kFormatType = 0x80;
constexpr std::size_t kFormatBody = 86;
constexpr std::size_t kLongest = 256 + kHead;

/// Of the format characters: bytes, and what the stored number is to be multiplied with.
struct Format {
  char character;
  std::size_t bytes;
  double factor;
};
constexpr std::array<Format, 18> kFormats = {{{'a', 64, 0},
                                              {'b', 1, 1},
                                              {'B', 1, 1},
                                              {'h', 2, 1},
                                              {'H', 2, 1},
                                              {'i', 4, 1},
                                              {'I', 4, 1},
                                              {'q', 8, 1},
                                              {'Q', 8, 1},
                                              {'f', 4, 1},
                                              {'d', 8, 1},
                                              {'n', 4, 0},
                                              {'N', 16, 0},
                                              {'Z', 64, 0},
                                              {'c', 2, 1e-2},
                                              {'C', 2, 1e-2},
                                              {'e', 4, 1e-2},
                                              {'E', 4, 1e-2}}};

Format format_of(char character) {
  if (character == 'L') return {'L', 4, 1e-7};
  if (character == 'M') return {'M', 1, 1};
  const auto* const it = std::find_if(kFormats.begin(), kFormats.end(),
                                      [&](const Format& f) { return f.character == character; });
  return it != kFormats.end() ? *it : Format{character, 0, 0};
}

/// Up to the first zero.
std::string fixed_text(std::span<const std::byte> bytes) {
  const std::string_view all = as_text(bytes);
  return std::string(all.substr(0, all.find('\0')));
}

}  // namespace

const DataFlashType::Field* DataFlashType::find(std::string_view field) const {
  const auto it = std::find_if(fields.begin(), fields.end(), [&](const Field& f) { return f.name == field; });
  return it != fields.end() ? &*it : nullptr;
}

std::int64_t DataFlashRecord::integer(const DataFlashType::Field& field) const {
  const std::size_t at = field.offset;
  switch (field.format) {
    case 'b':
      return load<std::int8_t>(body, at);
    case 'B':
    case 'M':
      return load<std::uint8_t>(body, at);
    case 'h':
    case 'c':
      return load<std::int16_t>(body, at);
    case 'H':
    case 'C':
      return load<std::uint16_t>(body, at);
    case 'i':
    case 'e':
    case 'L':
      return load<std::int32_t>(body, at);
    case 'I':
    case 'E':
      return load<std::uint32_t>(body, at);
    case 'q':
      return load<std::int64_t>(body, at);
    case 'Q':
      return static_cast<std::int64_t>(std::min<std::uint64_t>(load<std::uint64_t>(body, at), INT64_MAX));
    default:
      return 0;
  }
}

double DataFlashRecord::number(const DataFlashType::Field& field) const {
  // The log's multiplier already includes what the format implies.
  const double factor = field.multiplier != 0 ? field.multiplier : format_of(field.format).factor;
  if (field.format == 'f') return factor * load<float>(body, field.offset);
  if (field.format == 'd') return factor * load<double>(body, field.offset);
  return factor * static_cast<double>(integer(field));
}

std::string DataFlashRecord::text(const DataFlashType::Field& field) const {
  return fixed_text(body.subspan(field.offset, format_of(field.format).bytes));
}

DataFlashReader::DataFlashReader(ByteStream stream) : stream_(std::move(stream)) {
  auto& own = types_[kFormatType];  // describes itself, but something must come first
  own = std::make_unique<DataFlashType>();
  own->name = "FMT";
  own->body = kFormatBody;
}

Expected<DataFlashReader> DataFlashReader::open(const std::string& path) {
  auto stream = ByteStream::open(path);
  if (!stream) return stream.error();
  if (!starts_as_dataflash(as_text(stream->peek(kHead))))
    return Error{path, "is not a DataFlash log", "check the path"};
  return DataFlashReader(*std::move(stream));
}

/// Passes over bytes that begin no record of a known type; false at the end.
bool DataFlashReader::find_record() {
  while (true) {
    const auto bytes = stream_.peek(kHead);
    if (bytes.size() < kHead) return false;
    const auto mark = [&](std::size_t i) { return std::to_integer<std::uint8_t>(bytes[i]); };
    if (mark(0) == kMark1 && mark(1) == kMark2 && types_[mark(2)] != nullptr) return true;
    stream_.skip(1);
    ++unused_;
  }
}

bool DataFlashReader::next(DataFlashRecord& record) {
  stream_.skip(std::exchange(to_skip_, 0));
  if (find_record()) {
    const auto bytes = stream_.peek(kLongest);
    const DataFlashType* type = types_[std::to_integer<std::uint8_t>(bytes[2])].get();
    if (bytes.size() >= kHead + type->body) {
      record = {type, bytes.subspan(kHead, type->body)};
      record_byte_ = stream_.position();
      to_skip_ = kHead + type->body;
      learn(record);
      return true;
    }
  }
  const std::int64_t left = stream_.left();
  stream_.skip(static_cast<std::size_t>(left));
  unused_ += left;
  if (unused_ > 0 && !std::exchange(told_, true))
    log_warning(text(stream_.path(), ": ", unused_, " bytes of the log are no whole record"));
  return false;
}

void DataFlashReader::learn(const DataFlashRecord& record) {
  const DataFlashType& type = *record.type;
  if (&type == types_[kFormatType].get()) {
    add_type(record.body);
  } else if (type.name == "FMTU") {
    add_units(record);
  } else if (type.name == "UNIT" || type.name == "MULT") {
    const auto* id = type.find("Id");
    const auto* label = type.find("Label");
    const auto* factor = type.find("Mult");
    if (id == nullptr) return;
    const auto index = static_cast<std::size_t>(record.integer(*id) & 0xFF);
    if (label != nullptr) units_[index] = record.text(*label);
    if (factor != nullptr) multipliers_[index] = record.number(*factor);
  }
}

void DataFlashReader::add_type(std::span<const std::byte> body) {
  const auto id = load<std::uint8_t>(body), length = load<std::uint8_t>(body, 1);
  if (length < kHead || id == kFormatType) return;
  auto type = std::make_unique<DataFlashType>();
  type->name = fixed_text(body.subspan(2, 4));
  type->body = length - kHead;
  const std::string formats = fixed_text(body.subspan(6, 16));
  std::string labels = fixed_text(body.subspan(22, 64));
  std::size_t offset = 0;
  for (const char format : formats) {
    const std::size_t comma = std::min(labels.find(','), labels.size());
    type->fields.push_back({labels.substr(0, comma), format, offset, 0, ""});
    labels.erase(0, comma + 1);
    const std::size_t bytes = format_of(format).bytes;
    offset += bytes != 0 ? bytes : kLongest;  // unknown: fits nothing
  }
  if (offset != type->body) type->fields.clear();
  // A record given out before may still point to an old description; logs repeat them unchanged.
  auto& known = types_[id];
  if (known == nullptr) known = std::move(type);
}

void DataFlashReader::add_units(const DataFlashRecord& record) {
  const auto* id = record.type->find("FmtType");
  const auto* units = record.type->find("UnitIds");
  const auto* multipliers = record.type->find("MultIds");
  if (id == nullptr || units == nullptr || multipliers == nullptr) return;
  const auto& type = types_[static_cast<std::size_t>(record.integer(*id) & 0xFF)];
  if (type == nullptr) return;
  const std::string unit_ids = record.text(*units), multiplier_ids = record.text(*multipliers);
  for (std::size_t i = 0; i < type->fields.size(); ++i) {
    if (i < unit_ids.size()) type->fields[i].unit = units_[static_cast<unsigned char>(unit_ids[i])];
    if (i < multiplier_ids.size())
      type->fields[i].multiplier = multipliers_[static_cast<unsigned char>(multiplier_ids[i])];
  }
}

bool starts_as_dataflash(std::string_view head) { return head.starts_with("\xA3\x95\x80"); }

}  // namespace evpose
